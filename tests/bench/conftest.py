"""One thread for NumPy's linear algebra, and the ratios of each group under the table."""

import os

# Read once, when the linear algebra is loaded: the peers run on one core as the library does.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"

import pytest  # noqa: E402


def pytest_configure(config):
    config.ratio_lines = []


@pytest.fixture
def say(request):
    """Print a line below the tables."""
    return request.config.ratio_lines.append


def pytest_terminal_summary(terminalreporter, config):
    for line in config.ratio_lines:
        terminalreporter.write_line(line)
