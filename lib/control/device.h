/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A haptic device in its loop, for the checks of stability: what a later device fills in, it is judged by.
 *
 *   mass, damping ──pose, so often, so old──▶ plan ──force, so late, held for a tick──▶ mass
 */
#ifndef INCISE_DEVICE_H
#define INCISE_DEVICE_H

struct incise_device {
	double axis[3][3]; /* principal directions of its mass: unit, at right angles */
	double mass_kg[3]; /* along each, > 0 */
	double damping_N_s_mm; /* viscous, in all directions, ≥ 0 */
	double period_s;       /* of ticks; a force is held so long */
	double pose_s;	       /* from pose to pose … */
	double latency_s;      /* … and how old one is when it comes */
	int late_ticks;	       /* until a force acts */
	double slew_N_s;       /* the fastest that its force changes; infinite: at once */
	double force_N;	       /* the largest … */
	double continuous_N;   /* … and one that it keeps for ever */
};

#endif
