// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The larynx in relief, as smooth hills. Sizes are those of an adult: the membrane of
 * about 10 mm between thyroid and cricoid cartilage is where a cricothyroidotomy cuts.
 *
 *   head      thyroid cartilage      membrane  cricoid  trachea    chest
 *             notch  prominence         ╎       ring
 *               ╲  ▂▆█▇▆▅▄▃▂▁           ╎       ▂▃▂  ▁▁▁▁▁▁▁▁▁
 *   -40       -30      -20      -10     0        8      20     caudal_mm
 */
#include <math.h>
#include "larynx.h"

static double bell(double x, double width)
{
	return exp(-(x / width) * (x / width));
}

/* From 0 to 1 where x goes from -width to width. */
static double step(double x, double width)
{
	double t = fmin(fmax(0.5 + 0.5 * x / width, 0), 1);

	return t * t * t * (t * (6 * t - 15) + 10);
}

/*
 * Two plates that meet in the midline, highest at the prominence, lower towards the
 * membrane; above the prominence a notch parts them.
 */
static double thyroid(double caudal_mm, double side_mm)
{
	double ridge = 0.55 * bell(side_mm, 7) + 0.45 * bell(side_mm, 17);
	double along = step(caudal_mm + 31, 6) * step(-caudal_mm - 7, 5.5);
	double rise = 0.45 + 0.55 * bell(caudal_mm + 20, 9);
	double notch = 1 - 0.75 * bell(caudal_mm + 30, 6) * bell(side_mm, 4.5);

	return 4.6 * ridge * along * rise * notch;
}

double larynx_height_mm(double caudal_mm, double side_mm)
{
	double cricoid = 2.0 * bell(caudal_mm - 9.5, 5) * bell(side_mm, 14);
	double trachea = 0.7 * step(caudal_mm - 14, 8) * step(58 - caudal_mm, 16) *
			 bell(side_mm, 12);
	double height = thyroid(caudal_mm, side_mm) + cricoid + trachea;

	return isfinite(height) ? fmin(height, 5) : 0;
}
