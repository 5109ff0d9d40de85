// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The module of a stepper that is a CiA 402 drive behind a serial adapter that speaks slcan:
 * "slcan:/dev/ttyACM0:0x10". All it does is in can_stepper.h.
 */
#include "cia402/can_stepper.h"

CAN_STEPPER_BACKEND(can_transport_slcan, "slcan");
