"""A whole assessment by an exoskeleton: soft interfaces in full, as bushings, rigid coupling.

About 14 s are simulated, at 5 ms a step, on one thread. The peer is the published model on the same
engine, built again from its published numbers. Two threads share one plant, a run each.
"""

import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from ulna import exo

best = {}


@pytest.fixture(scope="module")
def full():
    return exo.exoskeleton(soft=True)


@pytest.fixture(scope="module")
def plants(full):
    return {"full": full, "reduced": full.reduced(), "rigid": exo.exoskeleton()}


@pytest.mark.parametrize("kind", ["full", "reduced", "rigid"])
def test_assessment(benchmark, plants, kind):
    found = benchmark.pedantic(exo.mobilise, args=(plants[kind],), rounds=5, warmup_rounds=1)
    assert found.status == "ok"
    best[kind] = benchmark.stats.stats.min
    benchmark.extra_info["simulated_s"] = found.simulated_s


def test_the_published_model(benchmark, capsys):
    found = benchmark.pedantic(exo.published_assessment, rounds=1)
    spent = benchmark.stats.stats.min
    with capsys.disabled():
        print(f"\nthe published model takes {spent:.1f} s; {found}")
        for kind, own in best.items():
            print(f"{kind}: {spent / own:.0f} times as fast")


def test_reduction(benchmark, full):
    benchmark.pedantic(full.reduced, rounds=2)


@pytest.mark.parametrize("kind", ["full", "reduced"])
def test_two_threads_share_a_plant(plants, kind, capsys):
    runs = {"full": 4, "reduced": 40}[kind]

    def spent(threads):
        begun = time.perf_counter()
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(lambda _: exo.mobilise(plants[kind]), range(runs)))
        return time.perf_counter() - begun

    one, two = min(spent(1) for _ in range(3)), min(spent(2) for _ in range(3))
    with capsys.disabled():
        print(f"\n{kind}: two threads do {one / two:.2f} times as much as one")
