"""In the guest: error frames on vcan0 through python-can, of four kinds of linux/can/error.h."""

import time

import can

TX_TIMEOUT, CONTROLLER, BUS_OFF, RESTARTED = 0x01, 0x04, 0x40, 0x100

with can.Bus("vcan0", "socketcan") as bus:
    for kind in (TX_TIMEOUT, CONTROLLER, BUS_OFF, RESTARTED):
        for _ in range(5):
            bus.send(
                can.Message(
                    arbitration_id=kind, is_error_frame=True, is_extended_id=False, data=bytes(8)
                )
            )
            time.sleep(0.02)
print("20 error frames sent by python-can: TX timeout, controller, bus-off, restarted")
