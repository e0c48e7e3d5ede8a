"""How few experiments the search needs: beside BoTorch, Optuna, scikit-optimize, bayesian-optimization, SMAC, random.

    pip install socasadi[peers]
    python studies/speed_tune.py [--methods A,B] [--problems P,Q] [--extra] [--repetitions N] [--jobs J]
    python studies/speed_tune.py --report [--figure]

All get the same ten seed points, those of a Sobol sequence scrambled by the number of the repetition, and then ask for
one point at a time; all search the unit cube (studies/peers/tune_search.py). Four functions whose minimum is known and
three searches of this package, whose J carries the noise of the sensor, another in every evaluation. A finished run is
kept at once, in the folder --out (studies/results/tune holds those of the page): the command can be stopped and given
again, goes on with what is missing, and every repetition is finished for all before the next is begun.
"""

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))

import numpy as np
from peers.tune_compare import SIGNIFICANT, Table
from peers.tune_functions import EXTRA, FUNCTIONS
from peers.tune_runs import SEED_POINTS, Results, Run, search
from peers.tune_search import METHODS
from peers.tune_studies import STUDIES
from threadpoolctl import threadpool_limits

PROBLEMS = {problem.name: problem for problem in (*FUNCTIONS, *STUDIES, *EXTRA)}
OURS, OWN = "socasadi", ("socasadi", "paper")
INSTANTS = (30, 50, 100)
HERE = Path(__file__).parent
FIGURE, RESULTS = HERE / "figures" / "tune-regret.png", HERE / "results" / "tune"

Job = tuple[str, str, int, int]


def main() -> None:
    parser = argparse.ArgumentParser(description="How few experiments the search needs, beside others.")
    parser.add_argument("--methods", help=f"of {', '.join(METHODS)} (all)")
    parser.add_argument("--problems", help=f"of {', '.join(PROBLEMS)} (the first seven)")
    parser.add_argument("--extra", action="store_true", help="also the problems that nobody tuned for")
    parser.add_argument("--repetitions", type=int, default=20, help="20; on the tuning problems no more than --dear")
    parser.add_argument("--dear", type=int, default=10, help="repetitions on the tuning problems (10)")
    parser.add_argument("--evaluations", type=int, default=100, help="of each run, with the ten seed points (100)")
    parser.add_argument("--jobs", type=int, default=1, help="processes (1)")
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder of the finished runs")
    parser.add_argument("--report", action="store_true", help="run nothing, only report")
    parser.add_argument("--figure", action="store_true", help=f"also draw {FIGURE.name}")
    chosen = parser.parse_args()
    if chosen.evaluations <= SEED_POINTS:
        parser.error(f"--evaluations: more than the {SEED_POINTS} seed points are needed, not {chosen.evaluations}")
    methods = named(parser, "--methods", chosen.methods, METHODS) or list(METHODS)
    usual = [name for name, problem in PROBLEMS.items() if chosen.extra or not problem.extra]
    problems = named(parser, "--problems", chosen.problems, PROBLEMS) or usual
    results = Results(chosen.out)
    if not chosen.report:
        counts = {name: chosen.repetitions for name in problems}
        counts |= {name: min(chosen.dear, chosen.repetitions) for name in problems if PROBLEMS[name].tuning}
        run(results, methods, counts, chosen.evaluations, chosen.jobs)
    runs = results.finished(chosen.evaluations).values()
    tables = [Table(PROBLEMS[name], runs, chosen.evaluations, methods) for name in problems]
    tables = [table for table in tables if table.costs]
    if not tables:
        raise SystemExit(f"{chosen.out} has no finished run of {chosen.evaluations} evaluations of these")
    instants = [instant for instant in INSTANTS if instant <= chosen.evaluations] or [chosen.evaluations]
    report(tables, instants)
    if chosen.figure:
        from peers.tune_figure import draw

        draw(tables, FIGURE)
        print(f"\n{FIGURE}")


def named(parser: argparse.ArgumentParser, option: str, given: str | None, known: dict) -> list[str]:
    """The names given, each of them known."""
    names = [name.strip() for name in given.split(",")] if given else []
    for name in names:
        if name not in known:
            parser.error(f"{option}: there is no {name!r}; there are {', '.join(known)}")
    return names


def run(results: Results, methods: Sequence[str], counts: dict[str, int], evaluations: int, jobs: int) -> None:
    """What is missing, one repetition of all after the other; each is kept as soon as it is done."""
    for name in methods:
        if METHODS[name].missing:
            print(f"{METHODS[name].title}: not installed ({METHODS[name].missing} is missing): skipped")
    methods = [name for name in methods if not METHODS[name].missing]
    finished = results.finished(evaluations)
    wanted = [
        (problem, method, repetition, evaluations)
        for repetition in range(max(counts.values()))
        for method in methods
        for problem, count in counts.items()
        if repetition < count and (PROBLEMS[problem].tuning or not METHODS[method].log)
        if (problem, method, repetition) not in finished
    ]
    for number, (job, done) in enumerate(carried_out(wanted, jobs), start=1):
        head = f"{number}/{len(wanted)} {job[0]}, {job[1]}, repetition {job[2]}:"
        if isinstance(done, Exception):
            print(f"{head} failed: {str(done)[:200]}", file=sys.stderr, flush=True)
            continue
        results.add(done)
        last = f"{done.best[-1][1]:.5g}" if done.best else "nothing but failures"
        print(f"{head} {last}, {done.failures} failures, {done.seconds:.2f} s of CPU an ask", flush=True)


def carried_out(wanted: Sequence[Job], jobs: int) -> Iterator[tuple[Job, Run | Exception]]:
    """The jobs with what they gave; of a method that cannot do one, the exception."""
    if jobs == 1:
        yield from ((job, carry_out(job)) for job in wanted)
        return
    pool = ProcessPoolExecutor(jobs, mp_context=get_context("spawn"))
    try:
        waiting = {pool.submit(carry_out, job): job for job in wanted}
        yield from ((waiting[future], future.result()) for future in as_completed(waiting))
    finally:
        pool.shutdown(cancel_futures=True)  # an interrupt does not wait for what has not begun


def carry_out(job: Job) -> Run | Exception:
    problem, method, repetition, evaluations = job
    try:
        with threadpool_limits(1):
            return search(PROBLEMS[problem], METHODS[method], repetition, evaluations)
    except Exception as error:  # a peer's, which must not end the comparison of the others
        return RuntimeError(f"{type(error).__name__}: {error}")


def report(tables: Sequence[Table], instants: Sequence[int]) -> None:
    tested = any(OURS in table.costs for table in tables)
    if tested:
        print(
            "'ours at N': socasadi is better or worse on the repetitions that both have run, and p of the paired test"
        )
    for table in tables:
        regrets(table, instants)
    processor(tables)
    if tested:
        summary(tables, instants)


def regrets(table: Table, instants: Sequence[int]) -> None:
    """Quartiles of the regret by method, lowest median first, and the paired tests."""
    known = "known" if table.problem.least is not None else "observed by any method in any repetition"
    print(f"\n{table.problem.title}: regret above {table.least:.6g}, the lowest {known}; median [quartiles]")
    if table.problem.note:
        print(f"({table.problem.note})")
    if unlike := table.unlike():
        print(f"NOT COMPARABLE: at the seed points of repetitions {unlike} methods saw unlike costs; rerun what is old")
    tested = OURS in table.costs
    columns = "".join(f"{f'after {instant}':>34}" for instant in instants)
    tests = "".join(f"{f'ours at {instant}':>16}" for instant in instants) if tested else ""
    print(f"{'':24}{'runs':>5}{columns}{tests}")
    for method in sorted(table.costs, key=lambda name: table.after(name, instants[-1])[1]):
        line = f"{METHODS[method].title:24}{len(table.costs[method]):5}"
        for instant in instants:
            low, median, high = table.after(method, instant)
            line += f"{f'{median:.4g} [{low:.3g}, {high:.3g}]':>34}"
        if tested and method != OURS:
            line += "".join(f"{table.against(OURS, method, instant)!s:>16}" for instant in instants)
        print(line)


def processor(tables: Sequence[Table]) -> None:
    width = max(len(table.problem.title) for table in tables) + 2
    print("\nCPU seconds of an ask and its tell, mean of a run after its seed points, median of the runs")
    methods = [name for name in METHODS if any(name in table.costs for table in tables)]
    print(" " * width + "".join(f"{METHODS[name].title:>23}" for name in methods))
    for table in tables:
        spent = [f"{np.median(table.seconds[name]):.3f}" if name in table.seconds else "-" for name in methods]
        print(f"{table.problem.title:{width}}" + "".join(f"{text:>23}" for text in spent))


def summary(tables: Sequence[Table], instants: Sequence[int]) -> None:
    """Where a peer has the lower median on the same repetitions and wins the paired test as well."""
    compared = [table for table in tables if OURS in table.costs and set(table.costs) - set(OWN)]
    if not compared:
        print("\nno peer has run these")
        return
    print(f"\nsocasadi is second where a peer has a lower median and p < {SIGNIFICANT:g} in the paired test as well")
    fewest = np.inf
    for instant in instants:
        first, lost = 0, []
        for table in compared:
            tests = {name: table.against(OURS, name, instant) for name in table.costs if name not in OWN}
            tests = {name: test for name, test in tests.items() if test.pairs}
            first += all(test.median <= test.others for test in tests.values())
            fewest = min([fewest, *(test.pairs for test in tests.values())])
            if seconds := [METHODS[name].title for name, test in tests.items() if test.second]:
                lost.append(f"; on {table.problem.title} second to {', '.join(seconds)}")
        second_to_none = f"second to none on {len(compared) - len(lost)} of {len(compared)} problems"
        print(f"  after {instant}: {second_to_none}, the lowest median on {first}{''.join(lost)}")
    for table in compared:
        for name in ("botorch", "botorch-log"):
            test = table.against(OURS, name, instants[0])
            if table.problem.tuning and test.pairs:
                medians = f"{test.median:.4g} against {test.others:.4g} of {METHODS[name].title}"
                print(f"  {table.problem.title}, after {instants[0]}: {medians} ({test}, {test.pairs} pairs)")
    if fewest < 6:
        print(f"  Of {fewest} pairs no test comes below {SIGNIFICANT:g}: it takes six.")


if __name__ == "__main__":
    main()
