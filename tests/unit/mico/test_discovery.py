"""Finding out what is connected, with the listener ahead of the device thread."""

import math
import queue

from cosmic.frame.clock import ManualClock
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.inbox import Inbox
from cosmic.mico.core.motion.channel_context import AxisReports, ChannelContext
from cosmic.mico.core.motion.data_container import DeviceDataContainer
from cosmic.mico.core.motion.device import Device
from cosmic.mico.core.motion.discovery import ChannelDiscovery
from cosmic.mico.core.motion.gate_queue import GateQueue
from cosmic.mico.core.motion.manager import DeviceManager
from cosmic.mico.core.motion.messages import Message
from cosmic.mico.hw.interface import Event
from unit.mico.rigs import settings
from unit.mico.scripted_controller import ScriptedController


def waiting(controller: ScriptedController) -> list[Event]:
    events: list[Event] = []
    try:
        while True:
            events.append(controller.queues[0].get_nowait())
    except queue.Empty:
        return events


def test_a_device_is_not_introduced_before_each_of_its_axes_was_asked_where_it_is():
    controller, mico = ScriptedController(("LLx",)), settings(("LLx",))
    controller.open()
    clock = ManualClock()
    manager = DeviceManager(controller, mico, clock=clock, policy=FailurePolicy())
    configured = {each.channel: each for each in mico.positioner}
    container = DeviceDataContainer(0, configured, math.inf, library_index=0)
    inbox: Inbox[Message] = Inbox(clock)
    policy = FailurePolicy()
    device = Device(
        controller, container, gate=manager.gate, clock=clock, settings=mico, policy=policy
    )
    discovery = ChannelDiscovery(
        ChannelContext(
            controller=controller,
            container=container,
            gate=manager.gate,
            clock=clock,
            settings=mico,
            queries=GateQueue(manager.gate, clock=clock, inbox=inbox, policy=policy, device=0),
            reports=AxisReports(device, container),
            inbox=inbox,
        )
    )

    def let_it_answer() -> None:
        for event in waiting(controller):
            container.apply(event)
            assert event.channel is not None
            axis = discovery.channels.get(event.channel.channel)
            if axis is None:
                discovery.take(event, event.channel.channel)
            else:
                axis.monitor.take(event)
            discovery.look()

    discovery.begin()
    let_it_answer()
    first, second = waiting(controller)  # the types of both channels
    container.apply(first)
    container.apply(second)
    discovery.take(first, 0)
    let_it_answer()
    assert discovery.channels[0].monitor.located
    assert not discovery.wait(0.0)
    discovery.take(second, 1)
    let_it_answer()
    assert discovery.wait(0.0)
    assert container.state(1).position == 0.0
