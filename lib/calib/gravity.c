// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Gravity at a place; see incise/calibrate_force.h. Constants of WGS 84, NIMA TR8350.2,
 * tables 3.1 to 3.4.
 */
#include <math.h>
#include <incise/calibrate_force.h>

double incise_calibrate_gravity(double latitude_deg, double altitude_m)
{
	const double a_m = 6378137, f = 1 / 298.257223563, m = 0.00344978650684;
	const double sine = sin(latitude_deg * (M_PI / 180)), s2 = sine * sine;
	const double h = altitude_m / a_m;
	double ground = 9.7803253359 * (1 + 0.00193185265241 * s2) /
			sqrt(1 - 0.00669437999014 * s2);

	return ground * (1 - 2 * (1 + f + m - 2 * f * s2) * h + 3 * h * h);
}
