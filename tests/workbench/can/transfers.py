"""Writes transfers.rs: transfers as an independent implementation of DroneCAN puts them on the bus.

Run it with PyPI dronecan 1.0.27: python3 tests/workbench/can/transfers.py > tests/workbench/can/transfers.rs
"""

import dronecan
from dronecan.transport import Transfer

KELVIN = 273.15
BATTERY_A, BATTERY_B, ESC, MONITOR = 42, 43, 50, 127
# What the rig sets up as the board's own node id.
BOARD = 10


def message(name, **fields):
    value = dronecan.TYPENAMES[name]()
    for field, content in fields.items():
        setattr(value, field, content)
    return value


def status():
    mode = dict(health=0, mode=0, sub_mode=0, vendor_specific_status_code=0, uptime_sec=1000)
    return message("uavcan.protocol.NodeStatus", **mode)


def battery(number, volts, amperes, celsius, percent, watt_hours, full_watt_hours):
    return message(
        "uavcan.equipment.power.BatteryInfo",
        temperature=celsius + KELVIN,
        voltage=volts,
        current=amperes,
        state_of_charge_pct=percent,
        remaining_capacity_wh=watt_hours,
        full_charge_capacity_wh=full_watt_hours,
        state_of_health_pct=100,
        status_flags=1,
        battery_id=number,
        model_name="org.battery",
    )


def module(volts):
    """ArduPilot's AP_Periph without a current sensor: 0 for all that it does not know."""
    return message(
        "uavcan.equipment.power.BatteryInfo",
        voltage=volts,
        state_of_health_pct=127,
        battery_id=1,
        model_instance_id=1,
        model_name="org.ardupilot.ap_periph -1",
    )


def auxiliary(number, cells, cycles, nominal):
    return message(
        "ardupilot.equipment.power.BatteryInfoAux",
        voltage_cell=cells,
        cycle_count=cycles,
        nominal_voltage=nominal,
        battery_id=number,
    )


def controller(index, volts, amperes, celsius, rpm):
    return message(
        "uavcan.equipment.esc.Status",
        voltage=volts,
        current=amperes,
        temperature=celsius + KELVIN,
        rpm=rpm,
        esc_index=index,
    )


CELLS = [4.125, 4.1875, 4.15625]

# Name, what it is, node, content, priority.
BROADCASTS = [
    ("STATUS_A", "NodeStatus of battery A", BATTERY_A, status(), 24),
    ("A", "Battery 1: 12.5 V, 3.25 A, 25.1 C, 76 %", BATTERY_A, battery(1, 12.5, 3.25, 25.1, 76, 50, 66), 16),
    ("A_LATER", "Battery 1: 12.25 V, 8.5 A, 30.1 C, 75 %", BATTERY_A, battery(1, 12.25, 8.5, 30.1, 75, 49, 66), 16),
    ("MODULE", "Battery 1: 12.5 V, and nothing else is known", BATTERY_A, module(12.5), 16),
    ("B", "Battery 2: 25 V, 16 A, 10.1 C, 40 %", BATTERY_B, battery(2, 25.0, 16.0, 10.1, 40, 100, 250), 16),
    ("B_LATER", "Battery 2: 24.5 V, 12 A, 12.1 C, 39 %", BATTERY_B, battery(2, 24.5, 12.0, 12.1, 39, 98, 250), 16),
    ("A_CELLS", "Cells of battery 1: 4.125, 4.1875, 4.15625 V", BATTERY_A, auxiliary(1, CELLS, 17, 11.1), 16),
    ("ESC_0", "Controller 0: 12 V, 4 A, 40.1 C", ESC, controller(0, 12.0, 4.0, 40.1, 1200), 16),
]

REQUESTS = [
    ("GET_NODE_INFO", "GetNodeInfo, of the board", dronecan.uavcan.protocol.GetNodeInfo.Request(), BOARD),
]


def frames(transfer):
    return [(frame.message_id, bytes(frame.bytes)) for frame in transfer.to_frames()]


def rust(name, meaning, content):
    print(f"/// {meaning}.\npub const {name}: Transfer = Transfer(&[")
    for identifier, data in content:
        data = ", ".join(f"0x{byte:02x}" for byte in data)
        print(f"    (0x{identifier:08x}, &[{data}]),")
    print("]);\n")


print("//! Written by transfers.py with PyPI dronecan 1.0.27, transfer id 0.\n")
print("use super::Transfer;\n")
for name, meaning, node, content, priority in BROADCASTS:
    transfer = Transfer(payload=content, source_node_id=node, transfer_id=0, transfer_priority=priority)
    rust(name, meaning, frames(transfer))
for name, meaning, content, node in REQUESTS:
    transfer = Transfer(
        payload=content,
        source_node_id=MONITOR,
        dest_node_id=node,
        transfer_id=0,
        transfer_priority=30,
        service_not_message=True,
        request_not_response=True,
    )
    rust(name, meaning, frames(transfer))
