"""A progress bar on a terminal, nothing in a pipe."""

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

T = TypeVar("T")


@contextmanager
def progress(words: str, total: int | None) -> Iterator[Callable[..., None]]:
    """A bar of `total` steps (None: unknown) on standard error; the context value is the function that advances it.

    It takes nothing where a step is done, or the words of the one that begins, which stand beside the bar from then on.
    """
    from rich import progress as rich
    from rich.console import Console

    words_and_bar = rich.TextColumn("{task.description:28}"), rich.BarColumn(), rich.MofNCompleteColumn()
    with rich.Progress(
        *(*words_and_bar, rich.TimeElapsedColumn(), rich.TimeRemainingColumn()),
        console=Console(stderr=True),
        disable=not sys.stderr.isatty(),
        transient=True,
        redirect_stdout=sys.stdout.isatty(),  # lines that go to a file are no concern of the bar
    ) as bar:
        task = bar.add_task(words, total=total)

        def tick(words: str | None = None) -> None:
            most = None if total is None else max(total, bar.tasks[0].completed + 1)  # where more came than expected
            bar.update(task, advance=1, description=words, total=most)

        yield tick


def collected(items: Iterable[T], words: str, total: int, show: Callable[[T], object] | None = None) -> list[T]:
    """Items that take long to make, with a bar of `total` steps; `show` is called with each as it is made."""
    found: list[T] = []
    with progress(words, total) as tick:
        for item in items:
            found.append(item)
            if show is not None:
                show(item)
            tick()
    return found
