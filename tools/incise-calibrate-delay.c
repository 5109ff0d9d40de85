// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate delay: delays between tracker, force channel and camera.
 */
#include "calibrate/calibrate.h"

int main(int argc, char **argv)
{
	return calibrate_delay(argc, argv);
}
