/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Values of a recording's streams at the time of a row of a resampled recording. Memory is that
 * of the samples near the row. mm, N, s; times in ns.
 *
 *     force    │││││││││││││││││   filtered if rows are fewer, else linear
 *     tracker  │      │      │     position and depth linear, orientation slerp
 *     camera     ○        ●        linear between two frames that found the handle
 *     row             ▲
 *
 * Uncertainties are standard ones: the noise of the samples around, with that of their times
 * multiplied by the speed. Each interpolator is closed even if its opening failed.
 */
#ifndef INCISE_INTERPOLATORS_H
#define INCISE_INTERPOLATORS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/budget.h>
#include "../control/model_input.h"
#include "../signal/smoother.h"
#include "../record/read/cut.h"
#include "../record/read/rows.h"

/* --- force --------------------------------------------------------------------------- */

#define INCISE_FORCE_HALF 8 /* width of the filter to each side, rows */

struct incise_force_code {
	int64_t t_ns;
	int32_t code;
};

struct incise_force_interpolator {
	struct incise_rows rows;
	struct incise_recording_force scale;
	int64_t first_ns, last_ns; /* of the table's first and last row */
	struct incise_force_code *samples;
	size_t n, capacity;
	double *weights; /* of |rows|, in small steps */
};

/* The force at a time, with its standard uncertainty from noise. */
struct incise_force_value {
	double force_N, u_N; /* NAN: none near */
	bool clipped;
	double share; /* of the noise of one sample */
};

/*
 * Weight of a force sample at this distance from the row: a sinc with its -6 dB at a third of
 * the rate of rows, under Blackman's window of 8 rows to each side. It is even, so phase and
 * delay are 0; the weights are divided by their sum, so a constant stays as it is. From half
 * the rate of rows on, where aliases would start, it passes less than 1e-3.
 */
double incise_force_weight(double rows);

/* Find the time of a table's last row, which is the end of a grid; before the first is read. */
int incise_rows_last(const struct incise_rows *rows, int64_t *last_ns,
		     struct incise_error *err);

/* Open, and read the first sample if there is one. Returns 0 or -errno. */
int incise_force_interpolator_open(struct incise_force_interpolator *force,
				   struct incise_recording *recording,
				   const struct incise_calibration *given,
				   struct incise_error *err);
void incise_force_interpolator_close(struct incise_force_interpolator *force);

/* Read another sample: 1, 0 at the end, -errno. */
int incise_force_interpolator_more(struct incise_force_interpolator *force,
				   struct incise_error *err);

/* Drop the first @n samples, once they are many. Returns how many were dropped. */
size_t incise_force_interpolator_forget(struct incise_force_interpolator *force,
					size_t n);

/* At the time of a sample. */
void incise_force_interpolator_sample(const struct incise_force_interpolator *force,
				      size_t at, struct incise_force_value *value);

/* Weighted over rows of this distance; NAN if no sample is within half a row. */
void incise_force_interpolator_filter(const struct incise_force_interpolator *force,
				      int64_t t_ns, double row_ns,
				      struct incise_force_value *value);

/* On the line between the samples before and after. */
void incise_force_interpolator_line(const struct incise_force_interpolator *force,
				    int64_t t_ns, struct incise_force_value *value);

/* --- pose of the blade --------------------------------------------------------------- */

struct incise_blade_record {
	int64_t seq, t_ns; /* INCISE_TIME_NONE: none */
	double position_mm[3], q[4];
	int station;
	bool error, button;
};

struct incise_blade_depth {
	int64_t t_ns;
	double depth_mm, velocity_mm_s;
	double noise_mm, depth_noise_mm, t_sd_s;
	double vector_mm_s[3]; /* velocity */
	bool advancing;
	bool inside;	  /* the tissue … */
	int64_t began_ns; /* … since then */
	double mean_speed_mm_s, deepest_mm, way_mm;
};

/*
 * The loop's filter, as it runs in a haptic loop: each pose arrives with the tracker's latency. A pose
 * waits here for its arrival, at most as many as INCISE_LOOP_POSES.
 */
#define INCISE_LOOP_POSES 256

struct incise_loop_motion {
	struct incise_predict predict;
	int64_t late_ns; /* from a row's time to its arrival */
	struct incise_tracker_sample waiting[INCISE_LOOP_POSES]; /* a ring */
	unsigned int first, last;
};

struct incise_blade_pose {
	struct incise_rows tracker, depth;
	struct incise_smooth smooth;
	double tip_mm[3]; /* calibrated: the rows have the device's own tip */
	bool ended;	  /* the rows of depth */
	/* before and after the row */
	struct incise_blade_record pose[2];
	struct incise_blade_depth deep[2];
	double angle, sine, sign;     /* between the two poses */
	double speed_mm_s, rate_mm_s; /* of position and of depth between the two */
	struct incise_cut_count cut;
	struct incise_cut_progress progress;
	struct incise_stay stay;
	struct incise_loop_motion loop;
};

/* NAN: not known. */
struct incise_blade_pose_value {
	double position_mm[3], position_u_mm, q[4];
	double depth_mm, depth_u_mm, velocity_mm_s;
	/* As in the haptic loop; see ../../control/model_input.h. Outside of tissue the last three are 0. */
	double acceleration_mm_s2, tilt_deg, time_in_tissue_s;
	double mean_speed_mm_s, deepest_mm;
	double way_mm;	      /* progress of the cut, which never falls within it */
	int64_t station, cut; /* 0: not known; outside cuts */
	bool button, interpolated, error;
	bool advancing; /* at both records around; false where depth is not known */
};

/* Returns 0 or -errno. */
int incise_blade_pose_open(struct incise_blade_pose *blade,
			   struct incise_recording *recording,
			   const struct incise_calibration *given,
			   struct incise_error *err);
void incise_blade_pose_close(struct incise_blade_pose *blade);

/* The pose at a time, not before that of the last call. Returns 0 or -errno. */
int incise_blade_pose_at(struct incise_blade_pose *blade, int64_t t_ns, double t_sd_s,
			 struct incise_blade_pose_value *value, struct incise_error *err);

/* The uncertainty budget's values of the row of the last call, but its force. */
void incise_blade_pose_budget(const struct incise_blade_pose *blade, int64_t t_ns,
			      const struct incise_blade_pose_value *value,
			      struct incise_budget_row *row);

/* Move from the device's tip to that of the blade; without a change of bits if it is the same. */
void incise_go_to_tip(const double tip_mm[3], const double q[4], double position_mm[3]);

/* --- camera -------------------------------------------------------------------------- */

#define INCISE_CAMERA_LOW_QUALITY 0.5

struct incise_camera_interpolator {
	struct incise_rows rows;
	double scale; /* of another calibration's depths */
	double mm_px; /* of the calibration in use */
	struct incise_camera_depth {
		int64_t t_ns; /* INCISE_TIME_NONE: none */
		double depth_mm, sd_mm, quality, t_sd_s;
	} frame[4];   /* two before and two after the row */
	double bend2; /* mean square of second derivatives of late, (mm/s²)² */
};

/* NAN: not seen. */
struct incise_camera_value {
	double depth_mm;
	double sd_mm; /* of the edge in the frame */
	double u_mm;  /* with the uncertainty of times, and motion between frames */
	double quality;
	bool low_quality; /* of either frame, or not seen */
};

/* Whether a recording has frames. 1, 0, -errno. */
int incise_camera_interpolator_any(struct incise_recording *recording,
				   struct incise_error *err);

/* Returns 0 or -errno. */
int incise_camera_interpolator_open(struct incise_camera_interpolator *camera,
				    struct incise_recording *recording,
				    const struct incise_calibration *given,
				    struct incise_error *err);
void incise_camera_interpolator_close(struct incise_camera_interpolator *camera);

/* At a time, not before that of the last call. Returns 0 or -errno. */
int incise_camera_interpolator_at(struct incise_camera_interpolator *camera, int64_t t_ns,
				  double t_sd_s, struct incise_camera_value *value,
				  struct incise_error *err);

#endif
