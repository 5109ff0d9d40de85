// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate force: sensitivity of the force channel, from weights.
 */
#include "calibrate/calibrate.h"

int main(int argc, char **argv)
{
	return calibrate_force(argc, argv);
}
