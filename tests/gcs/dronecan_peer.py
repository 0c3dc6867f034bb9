"""PyPI dronecan at the bus of the emulated board: a node with tools of its own, and devices that report through it."""

import pathlib
import queue
import threading
from collections import Counter
from concurrent.futures import Future

import dronecan
from dronecan.app.node_monitor import NodeMonitor
from dronecan.transport import Transfer

from slcan_pty import SlcanPort

# Not among the namespaces that it loads by itself. The others stay as they are: its own tools have their types.
standard = dronecan.uavcan
dronecan.load_dsdl(str(pathlib.Path(dronecan.__file__).parent / "dsdl_specs" / "mppt"), exclude_dist=True)
dronecan.uavcan = standard

BIT_RATE = 1_000_000
KELVIN = 273.15

# How often devices report.
INTERVAL_S = 0.1

Allocation = dronecan.uavcan.protocol.dynamic_node_id.Allocation
OutputEnable = dronecan.TYPENAMES["mppt.OutputEnable"]


def battery(number, volts, amperes, celsius=25, percent=50, watt_hours=100):
    return dronecan.uavcan.equipment.power.BatteryInfo(
        battery_id=number,
        voltage=volts,
        current=amperes,
        temperature=celsius + KELVIN,
        state_of_charge_pct=percent,
        remaining_capacity_wh=watt_hours * percent / 100,
        full_charge_capacity_wh=watt_hours,
    )


def auxiliary(number, cells, cycles, nominal_volts):
    return dronecan.TYPENAMES["ardupilot.equipment.power.BatteryInfoAux"](
        battery_id=number, voltage_cell=cells, cycle_count=cycles, nominal_voltage=nominal_volts
    )


def controller(index, volts, amperes, celsius):
    return dronecan.uavcan.equipment.esc.Status(
        esc_index=index, voltage=volts, current=amperes, temperature=celsius + KELVIN
    )


class Peer:
    """A node in a thread of its own, which also sends what devices with other node ids report."""

    def __init__(self, tcp_port, node_id):
        self.port = SlcanPort(tcp_port)
        self.node = dronecan.make_node(f"slcan:{self.port.name}", node_id=node_id, bitrate=BIT_RATE, baudrate=115200)
        self.node.mode = dronecan.uavcan.protocol.NodeStatus().MODE_OPERATIONAL
        self.monitor = NodeMonitor(self.node)
        self.reports = {}
        self.sent = Counter()
        self.node.periodic(INTERVAL_S, self.send_reports)
        self.calls = queue.SimpleQueue()
        self.over = threading.Event()
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def run(self):
        while not self.over.is_set():
            self.node.spin(0.02)
            while not self.calls.empty():
                function, future = self.calls.get()
                try:
                    future.set_result(function())
                except Exception as error:  # Raised again where it was called.
                    future.set_exception(error)

    def call(self, function):
        """The result of what is done in the thread of the node."""
        future = Future()
        self.calls.put((function, future))
        return future.result(timeout=10)

    def report(self, node_id, *messages):
        """The device with this id sends these from now on, ten times a second."""
        self.reports[node_id] = messages

    def silence(self, node_id):
        self.reports.pop(node_id)

    def send_reports(self):
        for node_id, messages in list(self.reports.items()):
            for message in messages:
                self.send(node_id, message)

    def send(self, node_id, message, **kind):
        key = node_id, type(message)
        transfer = Transfer(
            transfer_id=self.sent[key] % 32,
            source_node_id=node_id,
            payload=message,
            transfer_priority=dronecan.node.DEFAULT_TRANSFER_PRIORITY,
            **kind,
        )
        self.sent[key] += 1
        for frame in transfer.to_frames():
            self.node.can_driver.send(frame.message_id, frame.bytes, extended=True)

    def info(self, node_id):
        """What the node monitor knows of a node: its GetNodeInfo, with its latest status."""
        return self.call(lambda: self.monitor.exists(node_id) and self.monitor.get(node_id).info)

    def close(self):
        self.over.set()
        self.thread.join()
        self.node.close()
        self.port.close()


class Newcomer:
    """A node that has no id and asks for one, by the rules A to E of the message."""

    REQUEST_S = 0.8
    DISCRIMINATOR = 0x1234
    ANONYMOUS = 0

    def __init__(self, peer, unique_id):
        self.peer = peer
        self.unique_id = unique_id
        self.node_id = None
        self.answers = peer.node.add_handler(Allocation, self.take_answer)
        self.timer = peer.node.periodic(self.REQUEST_S, lambda: self.request(0))

    def request(self, start):
        end = start + Allocation().MAX_LENGTH_OF_UNIQUE_ID_IN_REQUEST
        message = Allocation(first_part_of_unique_id=start == 0)
        message.unique_id.from_bytes(self.unique_id[start:end])
        self.peer.send(self.ANONYMOUS, message, discriminator=self.DISCRIMINATOR)

    def take_answer(self, event):
        known = event.message.unique_id.to_bytes()
        if event.transfer.source_node_id == self.ANONYMOUS or not self.unique_id.startswith(known):
            return
        if len(known) < len(self.unique_id):
            self.request(len(known))
        elif event.message.node_id:
            self.node_id = event.message.node_id
            self.answers.remove()
            self.timer.remove()


class Charger:
    """A solar charger with the id of the peer, which reports both of its sides and whose output can be switched."""

    def __init__(self, peer):
        self.peer = peer
        self.is_on = True
        self.is_stuck = False
        self.requested = []
        self.node = peer.node
        self.requests = self.node.add_handler(OutputEnable, self.obey)

    def report(self, source, output, celsius, faults=0):
        """Volts and amperes of the source and of the output."""
        stream = dronecan.TYPENAMES["mppt.Stream"](
            fault_flags=faults,
            temperature=celsius,
            input_voltage=source[0],
            input_current=source[1],
            output_voltage=output[0],
            output_current=output[1],
        )
        self.peer.report(self.node.node_id, stream)

    def obey(self, event):
        wanted = bool(event.request.enable)
        assert wanted != bool(event.request.disable)
        self.requested.append("on" if wanted else "off")
        if not self.is_stuck:
            self.is_on = wanted
        return OutputEnable.Response(enabled=self.is_on)

    def close(self):
        self.peer.call(self.requests.remove)
