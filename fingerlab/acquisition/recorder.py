"""The recorder: reads the ring and writes each run straight to a file that survives its writer.

It runs in a process of its own (``bench/processes.py``): a stalled disk then holds up neither the control
loop nor the window, a crash of the window loses no sample, and a crash inside HDF5 (as by a full disk)
takes nothing with it but what was not yet flushed. On a virtual clock the same object is polled by hand
(``bench/process_bench.py``).
"""

from __future__ import annotations

import json
import re
import shutil
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import h5py
import numpy as np

from fingerlab.acquisition.recording import (
    LEAST_FREE_BYTES,
    OpenRun,
    RunInfo,
    SessionInfo,
    certain_columns,
    channel_units,
    channels_of,
    wired_lines,
)
from fingerlab.acquisition.ring import COLUMN, Array, Ring, RingReader, RowFlag
from fingerlab.acquisition.status import Number, SharedStatus, Slot, Text
from fingerlab.core.errors import Cancelled, UserError
from fingerlab.core.progress import Progress
from fingerlab.sessions.model import FINGER_PHASES
from fingerlab.sessions.recording_files import (
    CLEAN,
    CLOSED,
    LOSSY,
    PART_SUFFIX,
    TRUNCATED,
    VERIFYING,
    PartHeader,
    PartWriter,
    RecordingPlace,
    give_name,
)
from fingerlab.sessions.repair import MARKERS_SUFFIX, assemble_files, finish_recording

FLUSH_S = 0.1
"""Samples of this long are handed to the system at a time: less than half of what may be lost."""

LOOK_S = 0.25
"""How often the place is looked at."""

NEWEST = 8
"""Rows among which the newest whole one is looked for (assumed: more than one is never under way)."""


class Recorder:
    """Records runs into one session at a time.

    Args:
        rescue: folder for what can still be saved when the session's own folder has vanished.
        clock: seconds, only for how often the disk is looked at.
    """

    def __init__(
        self, ring: Ring, board: SharedStatus, rescue: Path, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._ring, self._board, self._rescue, self._clock = ring, board, rescue, clock
        self._info: SessionInfo | None = None
        self._place: RecordingPlace | None = None
        self._done: list[tuple[Path, h5py.File]] = []
        self._run: OpenRun | None = None
        self._why = ""
        self._lines: tuple[str, ...] = ()
        self._looked = -1.0
        self._errors = 0

    @property
    def recording(self) -> bool:
        """Whether a run is being written."""
        return self._run is not None

    def open(self, info: SessionInfo) -> None:
        """Claim the place of a session.

        Raises:
            UserError: the place is taken or cannot be written to, or a session is open already.
        """
        if self._place is not None:
            raise UserError(f"{self._place.path} is being recorded; close it before another is begun.")
        self._place, self._info, self._done = RecordingPlace.claim(info.path), info, []
        self._why = ""
        self._board[Slot.RECORDED_RUNS] = 0  # of this session: who waits for its first run counts from here
        self._lines = wired_lines(json.loads(info.rig))

    def begin(self, run: RunInfo) -> None:
        """Begin a run; it is written from the next ``poll`` on.

        Raises:
            UserError: no session is open, a run is under way, the device is gone, the disk is full, the rig
                lacks what a run of this phase needs, or the file cannot be made.
        """
        if self._place is None or self._info is None:
            raise UserError("No session is open for recording; choose where to record first.")
        if self._run is not None:
            raise UserError("A run is being recorded; end it before the next is begun.")
        if run.phase in FINGER_PHASES and not json.loads(self._info.rig).get("finger"):
            raise UserError(  # the file could not be opened again
                "The rig file names no finger, whose constants every run with one needs; give it a section "
                "[finger], or record the motor alone (motor bench)."
            )
        if self._board[Slot.LOOP_ENDED]:
            raise UserError("The device is gone and there is nothing to record; connect it again.")
        free = shutil.disk_usage(self._place.folder).free
        if free < LEAST_FREE_BYTES:
            raise UserError(
                f"The disk of {self._place.path.parent} has only {free / 1e6:.0f} MB left, and a run needs "
                f"{LEAST_FREE_BYTES / 1e6:.0f} MB to begin; make room, or choose another folder."
            )
        number = len(self._done) + 1
        path = self._place.folder / f"{number:03d}{PART_SUFFIX}"
        root = {
            "title": self._info.title,
            "created": self._info.created,
            "rig": self._info.rig,
            **self._info.attributes,
        }
        own = {
            "phase": run.phase,
            "cable": run.cable,
            "sample_rate_hz": float(run.sample_rate_hz),
            "trajectory": dict(run.trajectory),
            **run.attributes,
        }
        try:
            writer = PartWriter(path, PartHeader(root, own), channel_units(run.phase, self._lines))
        except (OSError, RuntimeError) as error:
            raise UserError(
                f"{self._place.path} cannot be written ({_reason(error)}); choose a place with room."
            ) from None
        self._run = OpenRun(run, writer, self._reader_from(run.start), run.stop, run.start)
        self._board[Slot.RECORDING] = 1
        for slot in (Slot.RECORDED, Slot.FLUSHED, Slot.GAPS, Slot.DROPPED):
            self._board[slot] = 0

    def pause(self, on: bool) -> None:
        """Leave samples out from now on, or go on; what is left out is a gap in time."""
        if self._run is None:
            raise UserError("Nothing is being recorded; there is nothing to pause.")
        self.poll()
        if self._run is not None:
            self._run.paused = on
            self._board[Slot.RECORDING] = 2 if on else 1

    def mark(self, note: str, index: int | None = None) -> None:
        """Put a marker with a note at a sample, the newest where none is given.

        Raises:
            UserError: nothing is being recorded, the sample came before the run, or the note cannot be
                written.
        """
        run = self._run
        if run is None:
            raise UserError("Nothing is being recorded; a marker belongs to a run.")
        index = self._board[Slot.INDEX] if index is None else index
        if index < run.info.start:
            raise UserError("That moment was before the run began; a marker belongs to the run that goes on.")
        marker = {"time": (index - run.info.start) / run.info.sample_rate_hz, "note": note}
        try:
            with run.writer.path.with_suffix(MARKERS_SUFFIX).open("a", encoding="utf-8") as file:
                file.write(json.dumps(marker, ensure_ascii=False) + "\n")
        except OSError as error:
            raise UserError(f"The marker cannot be written ({error.strerror}); make room.") from None

    def end(self, stop: int | None = None) -> None:
        """End the run before sample ``stop``, or with the newest sample.

        Raises:
            UserError: nothing is being recorded.
        """
        if self._run is None:
            raise UserError("Nothing is being recorded; there is nothing to end.")
        self._run.stop = self._board[Slot.INDEX] + 1 if stop is None else stop
        self.poll()

    def cut(self, note: str) -> None:
        """End the run with all that the ring still holds and say why it was cut."""
        while self._run is not None and self._take() > 0:
            pass
        if self._run is not None:
            self._finish(note)
        else:
            self._why = note

    def close(self, progress: Progress | None = None) -> Path:
        """Write the session whole, verify it, and give it its name; the board tells how far it is.

        Args:
            progress: called with the share done and what is being done; may raise ``Cancelled``.

        Returns:
            Its path.

        Raises:
            UserError: no session is open, it holds no sample, or the place is full.
            Cancelled: it was put off, by ``progress`` or through the board; the folder stays as it is.
        """
        if self._place is None:
            raise UserError("No session is open for recording.")
        if self._run is not None:
            self.end()
            if self._run is not None:
                self._finish("")
        place, self._place = self._place, None
        with suppress(OSError):
            (place.folder / CLOSED).write_text(self._why, encoding="utf-8")
        self._let_go()
        if not place.parts():
            place.remove()
            raise UserError(f"{place.path} would hold no runs and is not written; record at least one.")
        return finish_recording(place, self._reporting(progress))

    def _reporting(self, progress: Progress | None) -> Progress:
        """Tells the board how far the writing is, and that the recorder lives; stops where it is asked to."""
        board = self._board

        def report(share: float, what: str) -> None:
            board[Slot.RECORDER_BEAT] += 1
            board[Slot.VERIFYING] = int(what == VERIFYING)
            board.set_number(Number.WRITTEN, share)
            if board[Slot.PUT_OFF]:
                raise Cancelled
            if progress is not None:
                progress(share, what)

        return report

    def poll(self) -> bool:
        """Take what the ring has; whether there was anything. Never raises for the disk's sake."""
        self._board[Slot.RECORDER_BEAT] += 1
        try:
            taken = self._take()
            self._look()
        except (OSError, RuntimeError) as error:
            self._fail(error)
            return False
        return taken > 0

    def _take(self) -> int:
        run = self._run
        if run is None:
            return 0
        piece = run.reader.read()
        self._board[Slot.UNREAD] += piece.lost
        rows = piece.rows
        index = rows[:, COLUMN["index"]]
        inside = run.inside(index)
        note = ""
        if run.info.load_torque:
            note = run.end_with_motion(rows[inside], self._board)
            inside = run.inside(index)
        over = run.stop is not None and bool(len(index)) and index[-1] >= run.stop - 1
        if inside.any():
            self._write(run, rows[inside])
        if over:
            self._finish(note)
        return len(rows)

    def _write(self, run: OpenRun, rows: Array) -> None:
        index = rows[:, COLUMN["index"]]
        if run.paused:
            run.next, run.piece = int(index[-1]) + 1, 0
            return
        whole = np.isfinite(rows[:, [COLUMN[name] for name in certain_columns(run.info.phase)]]).all(axis=1)
        run.not_numbers += int((~whole).sum())
        rows, index = rows[whole], index[whole]
        if not len(rows):
            return
        run.count(index)
        self._board[Slot.GAPS], self._board[Slot.DROPPED] = run.gaps, run.dropped
        run.late += int(((rows[:, COLUMN["flags"]].astype(np.int64) & RowFlag.LATE) > 0).sum())
        run.writer.append(channels_of(run.info, rows, self._lines))
        run.waiting += len(rows)
        if run.waiting >= FLUSH_S * run.info.sample_rate_hz:
            run.writer.set_counts(run.dropped, run.late)
            run.writer.set_feed_forward(self._board.number(Number.FEED_FORWARD))
            run.writer.flush()
            run.waiting = 0
            self._board[Slot.FLUSHED] = run.writer.length
        self._board[Slot.RECORDED] = run.writer.length

    def _finish(self, note: str) -> None:
        """Close the run's file; ``note`` says why it was cut, and is empty where it was not."""
        run, self._run = self._run, None
        assert run is not None
        self._board[Slot.RECORDING] = 0
        wanted = run.info.stop
        complete = not note and (wanted is None or run.next >= wanted)
        ended = TRUNCATED if note else LOSSY if run.dropped else CLEAN
        run.writer.set_counts(run.dropped, run.late)
        run.writer.set_feed_forward(self._board.number(Number.FEED_FORWARD))
        run.writer.finish(ended, note or run.lossy_note, complete)
        path = run.writer.path
        self._board.set_text(Text.RUN, run.verdict(len(self._done) + 1))
        self._board[Slot.UNUSABLE] = not run.usable
        self._done.append((path, h5py.File(path, "r")))
        self._board[Slot.RECORDED_RUNS] = len(self._done)

    def _look(self) -> None:
        """See that the place is still there and has room."""
        now = self._clock()
        if self._place is None or now - self._looked < LOOK_S:
            return
        self._looked = now
        if not self._place.folder.is_dir():
            self._save_elsewhere()
            return
        free = shutil.disk_usage(self._place.folder).free
        self._board[Slot.FREE_BYTES] = free
        if free < LEAST_FREE_BYTES and self._run is not None:
            sentence = (
                f"The disk of {self._place.path.parent} has only {free / 1e6:.0f} MB left; the recording "
                "ended, what it has is kept, make room before the next."
            )
            self.cut(sentence)
            self._tell(sentence)

    def _fail(self, error: Exception) -> None:
        """The disk takes no more: leave the file as it is, it can be read up to the last flush."""
        assert self._place is not None
        run, place = self._run, self._place
        kept = place.folder.is_dir() and (run is None or run.writer.path.exists())
        words = "make room and open it: what was written is kept." if kept else "its files have been removed."
        sentence = f"{place.path} cannot be written ({_reason(error)}); the recording ended there, {words}"
        self._run = self._place = None
        self._board[Slot.RECORDING] = 0
        self._tell(sentence)
        if run is not None:
            with suppress(OSError, RuntimeError):
                run.writer.close()
        self._let_go()
        place.release()

    def _save_elsewhere(self) -> None:
        """The folder has vanished. Files that are open can still be read: save them in another place."""
        assert self._place is not None
        place, run = self._place, self._run
        self._place = self._run = None
        self._board[Slot.RECORDING] = 0
        self._tell(f"The folder {place.folder.parent} has vanished; the recording was ended.")
        files = list(self._done)
        if run is not None:
            with suppress(OSError, RuntimeError):
                run.writer.flush()
            files.append((run.writer.path, run.writer.file))
        try:
            self._rescue.mkdir(parents=True, exist_ok=True)
            whole = self._rescue / f"{place.path.name}.rescued"
            whole.unlink(missing_ok=True)
            assemble_files(files, whole, place.path)
            saved = give_name(whole, self._rescue / place.path.name)
        except (OSError, UserError, RuntimeError) as error:
            self._tell(f"The folder {place.folder.parent} has vanished, and its recording with it ({error}).")
        else:
            self._tell(f"The folder {place.folder.parent} has vanished; the recording was saved as {saved}.")
        finally:
            if run is not None:
                with suppress(OSError, RuntimeError):
                    run.writer.close()
            self._let_go()
            place.release()

    def _tell(self, sentence: str) -> None:
        self._board.set_text(Text.RECORDER, sentence)
        self._errors += 1
        self._board[Slot.RECORDER_ERRORS] = self._errors

    def _let_go(self) -> None:
        for _, file in self._done:
            with suppress(OSError, RuntimeError):
                file.close()
        self._done = []

    def _reader_from(self, index: int) -> RingReader:
        """A reader at or before sample ``index``, as far back as the ring goes.

        Placed by the number of the row that was looked at: the loop may have written more since.
        """
        written = self._ring.written
        first, rows = self._ring.copy(max(0, written - NEWEST), written)
        if not len(rows):
            return self._ring.reader()
        behind = int(rows[-1, COLUMN["index"]]) - index + 2
        return RingReader(self._ring, max(0, first + len(rows) - max(behind, 0)))


def _reason(error: Exception) -> str:
    text = str(getattr(error, "strerror", None) or " ".join(str(error).split()))
    matched = re.search("error message = '([^']+)'", text)  # HDF5 wraps the system's words into its own
    return matched[1] if matched else text
