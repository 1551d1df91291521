"""Finding out what is connected, with the listener ahead of the device thread."""

import math
import queue

from cosmic.frame.clock import ManualClock
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.inbox import Inbox
from cosmic.mico.core.motion.channel import ChannelController
from cosmic.mico.core.motion.channel_context import AxisReports, ChannelContext, GateQueue
from cosmic.mico.core.motion.data_container import DeviceDataContainer
from cosmic.mico.core.motion.device import Device
from cosmic.mico.core.motion.discovery import ChannelDiscovery
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
    context = ChannelContext(
        controller=controller,
        container=container,
        gate=manager.gate,
        clock=clock,
        settings=mico,
        queries=GateQueue(manager.gate, clock=clock, inbox=inbox, policy=policy, device=0),
        reports=AxisReports(device, container),
        inbox=inbox,
    )
    discovery = ChannelDiscovery(context)
    axes: dict[int, ChannelController] = {}

    def take(event: Event) -> None:
        assert event.channel is not None
        channel = event.channel.channel
        if channel in axes:
            axes[channel].monitor.take(event)
            return
        found = discovery.take(event, channel)
        if found is not None:
            axes[channel] = ChannelController(found, context)
            axes[channel].begin()

    def let_it_answer() -> None:
        for event in waiting(controller):
            container.apply(event)
            take(event)
            discovery.look({number for number, axis in axes.items() if axis.monitor.located})

    discovery.begin()
    let_it_answer()
    first, second = waiting(controller)  # the types of both channels
    container.apply(first)
    container.apply(second)
    take(first)
    let_it_answer()
    assert axes[0].monitor.located
    assert not discovery.wait(0.0)
    take(second)
    let_it_answer()
    assert discovery.wait(0.0)
    assert container.state(1).position == 0.0
