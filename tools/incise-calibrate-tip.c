// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate tip: where the tip of the blade is in the tracker's sensor.
 */
#include "calibrate/calibrate.h"

int main(int argc, char **argv)
{
	return calibrate_tip(argc, argv);
}
