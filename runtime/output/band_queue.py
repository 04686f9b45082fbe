"""A writer on a thread of its own: bands are coded and compressed while the next ones are made."""

from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Final, Self

from camkit.arrays import FloatArray
from camkit.runtime.output.picture_writer import PictureWriter

WAITING_BANDS: Final = 2


class BandQueue:
    """Takes bands as a `PictureWriter` does and hands them to one in order, on one thread.

    As a context it waits for the last band at the end of the block; after an error in the block
    it drops the bands that wait. Its thread has ended when the block has. The writer's own
    context stays with the caller, around this one.
    """

    def __init__(self, writer: PictureWriter) -> None:
        self._writer = writer
        self._waiting: deque[Future[None]] = deque()
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="camkit-writer")

    def write(self, band: FloatArray) -> None:
        """Append a (3, rows, w) band, which must not be changed afterwards.

        Raises:
            ContractError: What the writer says of a band before this one.
            OSError: Likewise.
        """
        while len(self._waiting) >= WAITING_BANDS:
            self._waiting.popleft().result()
        self._waiting.append(self._pool.submit(self._writer.write, band))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        with self._pool:
            if kind is not None:
                self._pool.shutdown(wait=False, cancel_futures=True)
                return
            while self._waiting:
                self._waiting.popleft().result()
