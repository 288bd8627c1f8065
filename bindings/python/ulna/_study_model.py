"""Models that a study's file names: a function in a file or module, or any program."""

from __future__ import annotations

import difflib
import hashlib
import importlib
import importlib.util
import inspect
import json
import re
import shutil
import subprocess
import sys
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ._call import ArgumentError
from ._study_call import RunFailed, exit_words
from ._study_plan import innermost
from .record import refuse


class FileModel:
    """``model.py:function`` or ``package.module:function``, loaded where it is first called."""

    def __init__(self, words: str, folder: Path) -> None:
        place, colon, name = words.rpartition(":")
        if not colon or not place or not name:
            raise refuse(
                f"model is {words!r}; it must be 'file.py:function' or 'module:function'", "model"
            )
        self.name = self.plan_name = name
        self.folder = str(folder.resolve())
        self.path = str((folder / place).resolve()) if place.endswith(".py") else None
        self.module = None if self.path else place
        self.plan_source = self._source()
        self._function: Callable[..., Any] | None = None
        self._load()
        if self.path is None:
            self.plan_source = self._module_source()

    def _source(self) -> str:
        if self.path is None:
            return f"{self.module}:{self.name}"
        try:
            return Path(self.path).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as failure:
            raise refuse(f"the model {self.path} cannot be read ({failure})", "model") from failure

    def _module_source(self) -> str:
        """The module's name and text, and that of the file that it has the function from."""
        found = inspect.unwrap(innermost(self.function()))
        modules = dict.fromkeys((self.module, getattr(found, "__module__", None)))
        texts = []
        for module in modules:
            try:
                texts.append(inspect.getsource(sys.modules[str(module)]))
            except (KeyError, OSError, TypeError):  # of a compiled module the name must do
                pass
        return "\n".join([f"{self.module}:{self.name}", *texts])

    def _load(self) -> None:
        """Load it before a study is made of it; what goes wrong is a refusal."""
        try:
            self.function()
        except ArgumentError:
            raise
        except ImportError as failure:
            raise refuse(f"the model cannot be imported ({failure})", "model") from failure
        except (Exception, SystemExit) as failure:
            words = f"the model cannot be loaded ({self._fault(failure)})"
            raise refuse(words, "model") from failure

    def _fault(self, failure: BaseException) -> str:
        """An error in the model's file, and where it is."""
        if isinstance(failure, SystemExit):
            what = exit_words(failure)
        else:
            what = f"{type(failure).__name__}: {getattr(failure, 'msg', None) or failure}"
        if isinstance(failure, SyntaxError):
            return f"{what}, {failure.filename} line {failure.lineno}"
        frames = traceback.extract_tb(failure.__traceback__)
        own = [frame for frame in frames if frame.filename == self.path] or frames[-1:]
        return f"{what}, {own[-1].filename} line {own[-1].lineno}"

    def function(self) -> Callable[..., Any]:
        """The function itself."""
        if self._function is not None:
            return self._function
        if self.folder not in sys.path:
            sys.path.append(self.folder)  # what the model imports from beside it
        if self.path is None:
            module: Any = importlib.import_module(self.module or "")
        else:
            if self._source() != self.plan_source:
                raise refuse(f"the model {self.path} was changed while the study ran", "model")
            digest = hashlib.sha256(self.path.encode()).hexdigest()[:12]
            spec = importlib.util.spec_from_file_location(f"ulna_model_{digest}", self.path)
            assert spec is not None and spec.loader is not None
            module = importlib.util.module_from_spec(spec)
            sys.modules[spec.name] = module
            spec.loader.exec_module(module)
        found = getattr(module, self.name, None)
        if not callable(found):
            raise refuse(f"{self.path or self.module} has no function {self.name!r}", "model")
        self._function = found
        return found

    def prepare(self) -> None:
        """Load it before the first run."""
        self.function()

    def __call__(self, **named: Any) -> Any:
        return self.function()(**named)

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_function": None}


class ProgramModel:
    """A program: values take the place of ``{name}`` in its words, or come as JSON on its input.

    The last line it prints is the result: JSON, or numbers with blanks between. An exit status
    other than 0 is a failed run.
    """

    def __init__(
        self,
        words: Sequence[str],
        names: Sequence[str],
        outputs: Sequence[str],
        folder: Path,
        timeout_s: float | None,
    ) -> None:
        if not words or not all(isinstance(word, str) for word in words):
            raise refuse("program must be a list of words, as ['./simulate', '{k}']", "program")
        self.words = tuple(words)
        self.names = tuple(names)
        self.outputs = tuple(outputs)
        self.folder = str(folder.resolve())
        self.timeout_s = timeout_s
        self.by_input = self._takes_input()
        first = words[0]
        beside = folder / first
        if "/" in first:
            self.words = (str(beside.resolve()), *self.words[1:])
        if shutil.which(self.words[0]) is None:
            raise refuse(f"the program {first!r} cannot be found or run", "program")
        # Files among the words belong to the plan: the script of an interpreter, say.
        digests = {
            word: hashlib.sha256((folder / word).read_bytes()).hexdigest()
            for word in words
            if "{" not in word and (folder / word).is_file()
        }
        self.plan_name = words[0]
        self.plan_source = json.dumps([list(words), digests], sort_keys=True)

    def _takes_input(self) -> bool:
        """Whether no factor has a place among the words; refuse places that are wrong."""
        unplaced = [name for name in self.names if not any(f"{{{name}}}" in w for w in self.words)]
        if unplaced and len(unplaced) < len(self.names):
            raise refuse(
                f"the program has no place for the factor {unplaced[0]!r}: write {{{unplaced[0]}}} "
                "among its words, or no factor at all, and it gets all of them on its input",
                "program",
            )
        for word in self.words:
            place = re.fullmatch(r"(?:.*=)?\{(\w+)\}", word)
            close = difflib.get_close_matches(place[1], unplaced, n=1) if place else []
            if close:
                raise refuse(
                    f"the program's {word!r} names no factor; did you mean {{{close[0]}}}?", "program"
                )
        return len(unplaced) == len(self.names)

    def __call__(self, **named: float) -> Any:
        words = list(self.words)
        if not self.by_input:
            for name, value in named.items():
                words = [word.replace(f"{{{name}}}", repr(value)) for word in words]
        try:
            done = subprocess.run(
                words,
                input=json.dumps(named) if self.by_input else None,
                stdin=None if self.by_input else subprocess.DEVNULL,
                capture_output=True,
                text=True,
                cwd=self.folder,
                timeout=self.timeout_s,
                check=False,
            )
        except subprocess.TimeoutExpired as failure:
            raise RunFailed("timeout", f"took longer than {self.timeout_s:g} s") from failure
        said = [line for line in done.stderr.splitlines() if line.strip()]
        if done.returncode < 0:
            raise RunFailed("crashed", f"the program died of signal {-done.returncode}")
        if done.returncode:
            last = f": {said[-1].strip()[:300]}" if said else ""
            raise RunFailed("raised", f"the program ended with exit status {done.returncode}{last}")
        lines = [line for line in done.stdout.splitlines() if line.strip()]
        if not lines:
            raise RunFailed("raised", "the program printed nothing")
        return self._result(lines[-1])

    def _result(self, line: str) -> Any:
        try:
            found = json.loads(line)
        except ValueError:
            try:
                found = [float(word) for word in line.replace(",", " ").split()]
            except ValueError as failure:
                raise RunFailed("raised", f"the program printed no result: {line[:200]}") from failure
        if isinstance(found, list) and len(found) == 1:
            return found[0]
        if isinstance(found, dict) and len(self.outputs) == 1 and self.outputs[0] in found:
            return found[self.outputs[0]]
        return found
