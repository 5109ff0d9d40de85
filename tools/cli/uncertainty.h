/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A measured value and its expanded uncertainty U (k = 2) as text, for every table that prints both.
 */
#ifndef INCISE_UNCERTAINTY_H
#define INCISE_UNCERTAINTY_H

#define UNCERTAINTY_TEXT 64

/*
 * "1238.4 ± 1.9 mV/N": U has two significant digits, and the value ends at the same digit.
 * @unit: may be "". A value without a known U, NaN or 0, has six significant digits and no ±; one that is
 * not finite is "-". Returns @text.
 */
const char *uncertainty_text(double value, double U, const char *unit,
			     char text[UNCERTAINTY_TEXT]);

#endif
