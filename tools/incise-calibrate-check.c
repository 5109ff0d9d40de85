// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate check: the state and age of each calibration.
 */
#include "calibrate/calibrate.h"

int main(int argc, char **argv)
{
	return calibrate_check(argc, argv);
}
