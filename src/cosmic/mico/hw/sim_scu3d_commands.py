"""What the commands of section II do to a simulated channel, beyond setting one number.

Each takes the channel, the time in s and the arguments of the C function; it returns the answers
and raises `Refusal` as the hardware would.
"""

from cosmic.mico.hw import sim_scu3d_moves as moves
from cosmic.mico.hw.scu3d_ctypes import SA_NOT_PROCESSABLE_ERROR, SA_WRONG_SENSOR_TYPE_ERROR
from cosmic.mico.hw.sim_scu3d_channel import Channel
from cosmic.mico.hw.sim_scu3d_scale import folded
from cosmic.mico.hw.sim_scu3d_types import Movement, Reference, Refusal

Values = tuple[int, ...]


def _require_linear(channel: Channel) -> None:
    channel.require_sensor()
    if channel.movement is not Movement.LINEAR:
        raise Refusal(SA_WRONG_SENSOR_TYPE_ERROR)


def _require_rotary(channel: Channel) -> None:
    channel.require_sensor()
    if channel.movement is Movement.LINEAR:
        raise Refusal(SA_WRONG_SENSOR_TYPE_ERROR)


def _require_rest(channel: Channel) -> None:
    if channel.moving:
        raise Refusal(SA_NOT_PROCESSABLE_ERROR)


def get_position(channel: Channel, now_s: float) -> Values:
    """Answer the position of a linear channel, 0.1 um."""
    _require_linear(channel)
    return (channel.counts(now_s),)


def get_angle(channel: Channel, now_s: float) -> Values:
    """Answer angle and revolution of a rotary channel, 0.1 mdeg; the revolution is reserved."""
    _require_rotary(channel)
    return (folded(channel.counts(now_s)), 0)


def move_step(channel: Channel, now_s: float, steps: int, amplitude: int, rate: int) -> Values:
    """Step in open loop; amplitude in 0.1 V, rate in Hz."""
    moves.step(channel, now_s, steps, amplitude_dv=amplitude, frequency_hz=rate)
    return ()


def position_absolute(channel: Channel, now_s: float, position: int, hold: int) -> Values:
    """Go to a position, 0.1 um, and hold it, ms."""
    _require_linear(channel)
    moves.drive(channel, now_s, channel.scale.position(position), hold)
    return ()


def position_relative(channel: Channel, now_s: float, diff: int, hold: int) -> Values:
    """Go by a distance from where it is now, 0.1 um, and hold, ms."""
    _require_linear(channel)
    moves.drive(channel, now_s, channel.stage.position(now_s) + channel.scale.distance(diff), hold)
    return ()


def angle_absolute(
    channel: Channel, now_s: float, angle: int, _revolution: int, hold: int
) -> Values:
    """Go to an angle, 0.1 mdeg, and hold it, ms."""
    _require_rotary(channel)
    moves.drive(channel, now_s, channel.scale.position(angle), hold)
    return ()


def angle_relative(
    channel: Channel, now_s: float, diff: int, _revolution: int, hold: int
) -> Values:
    """Go by an angle from where it is now, 0.1 mdeg, and hold, ms."""
    _require_rotary(channel)
    moves.drive(channel, now_s, channel.stage.position(now_s) + channel.scale.distance(diff), hold)
    return ()


def stop(channel: Channel, now_s: float) -> Values:
    """Stop whatever goes on."""
    channel.stop(now_s)
    return ()


def set_zero(channel: Channel, now_s: float) -> Values:
    """Make the present position zero; not while moving."""
    channel.require_sensor()
    _require_rest(channel)
    channel.scale.set_zero(channel.stage.position(now_s))
    return ()


def set_sensor_type(channel: Channel, _now_s: float, code: int) -> Values:
    """Set what is connected; another type is uncalibrated and nowhere."""
    _require_rest(channel)
    if code != channel.positioner_type:
        channel.positioner_type = code
        channel.calibrated = False
        channel.scale.known = False
    return ()


def set_safe_direction(channel: Channel, _now_s: float, direction: int) -> Values:
    """Set where a reference run starts; a new direction needs a new calibration."""
    if direction != channel.safe_direction:
        channel.safe_direction = direction
        channel.calibrated = False
    return ()


def set_scale(channel: Channel, _now_s: float, scale: int, inverted: int) -> Values:
    """Store offset, nm or micro-degree, and inversion."""
    channel.require_sensor()
    _require_rest(channel)
    if channel.reference is Reference.END_STOP and bool(inverted) != channel.scale.inverted:
        channel.calibrated = False
    channel.scale.store(scale, inverted=bool(inverted))
    return ()


def get_scale(channel: Channel, _now_s: float) -> Values:
    """Answer stored offset and inversion."""
    return (channel.scale.scale_fine, int(channel.scale.inverted))


def set_alignment(channel: Channel, _now_s: float, *alignment: int) -> Values:
    """Set alignment and both closed-loop amplitudes, 0.1 V."""
    channel.alignment = (alignment[0], alignment[1], alignment[2])
    return ()


def sensor_present(channel: Channel, _now_s: float) -> Values:
    """Answer whether a sensor is there."""
    return (int(channel.sensor_present),)


def known(channel: Channel, _now_s: float) -> Values:
    """Answer whether the position is referenced."""
    return (int(channel.scale.known),)
