"""Registers of Navitar's first generation, and of BrightLight, in frames of seven bytes."""

from typing_extensions import override

from cosmic.frame.errors import DeviceFault, DeviceTimeout, ProtocolError
from cosmic.vico.hw.navitar_protocol import FRAME_BYTES, find_answer, read_frame, write_frame
from cosmic.vico.hw.navitar_registers import TRIES, Registers
from cosmic.vico.hw.serial_port import MOST_BYTES, Deadline, SerialPort


class FrameRegisters(Registers):
    """Asks in frames, and finds the answer among noise.

    Parameters
    ----------
    port : SerialPort
        Closed with this object.
    tries : int
        How often a question is asked before it fails.
    """

    def __init__(self, port: SerialPort, *, tries: int = TRIES) -> None:
        self._port = port
        self._tries = tries

    @property
    @override
    def name(self) -> str:
        return self._port.name

    @override
    def read(self, register: int) -> int:
        return self._ask(read_frame(register), register)

    @override
    def write(self, register: int, value: int) -> None:
        self._ask(write_frame(register, value), register)

    @override
    def close(self) -> None:
        self._port.close()

    def _ask(self, question: bytes, register: int) -> int:
        received = b""
        for _ in range(self._tries):
            self._port.send(question)
            heard, value = self._listen(register)
            if value is not None:
                return value
            received += heard
        asked = f"{self.name}: asked {question.hex(' ')} {self._tries} times"
        if not received:
            raise DeviceTimeout(
                f"{asked}, no answer came; is the controller switched on, and is it this port?",
                fault=DeviceFault.TIMEOUT,
            )
        raise ProtocolError(f"{asked}, received {received[-32:].hex(' ')}, which is no answer")

    def _listen(self, register: int) -> tuple[bytes, int | None]:
        """Return what was received, and the answer in it."""
        received = self._port.read(FRAME_BYTES)
        value = find_answer(received, register)
        if value is not None or len(received) < FRAME_BYTES:
            return received, value  # fewer: the time-out is over
        # Noise came in front: the rest of the answer is still under way.
        deadline = Deadline()
        while value is None and len(received) < MOST_BYTES and not deadline.passed:
            more = self._port.read(1)
            if not more:
                break
            received += more
            value = find_answer(received, register)
        return received, value
