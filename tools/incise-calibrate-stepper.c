// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate stepper: force per microstep of the actuator, its backlash and its limits.
 */
#include "calibrate/calibrate.h"

int main(int argc, char **argv)
{
	return calibrate_stepper(argc, argv);
}
