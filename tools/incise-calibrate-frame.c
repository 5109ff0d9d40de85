// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate frame: where a haptic device is in the scene.
 */
#include "calibrate/calibrate.h"

int main(int argc, char **argv)
{
	return calibrate_frame(argc, argv);
}
