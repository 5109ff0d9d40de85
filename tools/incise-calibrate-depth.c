// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate depth: the scale of the camera's frame in the plane of the scalpel.
 */
#include "calibrate/calibrate.h"

int main(int argc, char **argv)
{
	return calibrate_depth(argc, argv);
}
