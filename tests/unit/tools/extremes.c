// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Properties under extreme inputs at all interfaces but the plan's, which has a test of its own:
 * see tests/extremes.
 */
#include "../../extremes/tested.h"

int main(void)
{
	static const struct property *const tables[] = {
		model_properties,   fixed_properties,  surface_properties,
		control_properties, motion_properties, wall_properties,
		device_properties,  file_properties,   NULL};

	return test_properties(tables);
}
