/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Where the blade was at the time of a row of a resampled recording, and what that is
 * worth: position, orientation, depth and speed between the tracker's records.
 *
 *     tracker │      │      │     position and depth linear, orientation slerp
 *     row         ▲
 *
 * Uncertainties are standard ones: the records' noise, of second differences (smooth.h), on
 * the line between two, with the uncertainty of the tracker's times against those of force
 * times the speed. mm, s.
 */
#ifndef INCISE_BLADE_H
#define INCISE_BLADE_H

#include <stdbool.h>
#include <stdint.h>
#include "../read/cut.h"
#include "../read/rows.h"
#include "smooth.h"

struct incise_blade_pose {
	int64_t seq, t_ns; /* INCISE_TIME_NONE: none */
	double position_mm[3], q[4];
	int station;
	bool error, button;
};

struct incise_blade_depth {
	int64_t t_ns;
	double depth_mm, velocity_mm_s;
	double noise_mm, depth_noise_mm, t_sd_s;
};

struct incise_blade {
	struct incise_rows tracker, depth;
	struct incise_smooth smooth;
	double tip_mm
		[3]; /* of the recording's calibration: rows are of the device's own */
	bool ended;  /* the depth's rows */
	/* before and after the row */
	struct incise_blade_pose pose[2];
	struct incise_blade_depth deep[2];
	double angle, sine, sign;     /* between the two poses */
	double speed_mm_s, rate_mm_s; /* between the two, of position and of depth */
	struct incise_cut cut;
};

/* All of it at one time; what is not known is NAN. */
struct incise_blade_value {
	double position_mm[3], position_u_mm, q[4];
	double depth_mm, depth_u_mm, velocity_mm_s;
	int station, cut; /* 0: not known; outside of cuts */
	bool button, interpolated, error;
};

/* Returns 0 or -errno; to be closed in any case. */
int incise_blade_open(struct incise_blade *blade, struct incise_recording *recording,
		      const struct incise_calibration *given, struct incise_error *err);
void incise_blade_close(struct incise_blade *blade);

/* Where it was at a time, not before that of the last call. Returns 0 or -errno. */
int incise_blade_at(struct incise_blade *blade, int64_t t_ns, double t_sd_s,
		    struct incise_blade_value *value, struct incise_error *err);

#endif
