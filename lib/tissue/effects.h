/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The forces of paper 2, each added to the force on the tool. P is the tool's end, P0
 * where the contact began, n the outward normal (the paper's Sn, or Snavg).
 *
 *   cutting     reaction    F += Kn d n                      §2.2, Fn
 *               plane       F -= Kx ((P-P0)·s) s             §2.2, Fx
 *   insertion   insertion   F += Ky d n Fort                 §2.3, Fy
 *               spread      F -= Kxz (I - n nᵀ)(P-P0)        §2.3, Fxz
 *   both        damping     F -= Kd v                        §2.2, Fd
 *
 * Read against the paper's print:
 *
 * - Fn and Fy print (P-P0)·Sn for the depth and call it the depth of penetration along
 *   Sn. On a plane the two are one. On a curved surface they part: the blade that glides
 *   along a neck without pressing has (P-P0)·Sn > 0, which would pull it in. Here d is
 *   the depth below the surface.
 * - Fd prints +Kd v. It is to damp, so it opposes v.
 * - Fxz prints a product of three distances along (Q0-P0), which is zero for ever when
 *   the contact begins on the surface. Its sentence asks for a force proportional to the
 *   distance of the instrument from where its contact began: that is what stands here.
 */
#ifndef INCISE_EFFECTS_H
#define INCISE_EFFECTS_H

#include <incise/export.h>
/* Fn, with the size of the force: Kn d, or what paper 1's model says. */
void incise_effect_reaction(double force[3], double size_N,
			    const double n[3]) INCISE_REALTIME;

/* Fx: the blade stays in the plane of its cut; side is Sx(0), the blade's unit normal. */
void incise_effect_plane(double force[3], double k_N_mm, const double p[3],
			 const double p0[3], const double side[3]) INCISE_REALTIME;

void incise_effect_damping(double force[3], double k_N_s_mm,
			   const double v[3]) INCISE_REALTIME;

/*
 * Fort, aligned … 1: how much a flat instrument is held up by its turn. flat is the unit
 * normal of its flat side, along the unit direction of the cut: with the flat along the
 * cut their product is 0, which is easy, but not free; across the cut it is 1.
 */
double incise_orientation_factor(const double flat[3], const double along[3],
				 double aligned) INCISE_REALTIME;

void incise_effect_spread(double force[3], double k_N_mm, const double p[3],
			  const double p0[3], const double n[3]) INCISE_REALTIME;

#endif
