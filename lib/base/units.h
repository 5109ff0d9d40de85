/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Units: lengths are mm and forces N, so that a mass is N s²/mm.
 */
#ifndef INCISE_UNITS_H
#define INCISE_UNITS_H

#define N_S2_PER_MM_KG 1e-3 /* 1 kg = 1 N s²/m */

#endif
