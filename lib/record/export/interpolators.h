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
#include "../../control/model_input.h"
#include "../../control/predict.h"
#include "../read/cut.h"
#include "../read/rows.h"

/* --- velocity of the tip ------------------------------------------------------------- */

struct incise_smooth_record {
	int64_t seq, t_ns;
	double position_mm[3], depth_mm, t_sd_s; /* given */
	double line_mm_s;			 /* given: speed by table depth */
	double velocity_mm_s[3];		 /* NAN: of an invalid position */
	double noise_mm, depth_noise_mm; /* standard deviations of one; NAN: not known */
	/* forward */
	double residual_mm[3], periods; /* since the record before */
	bool starts, skipped, even;
	double bend2_mm2, depth_bend2_mm2; /* second differences, squared */
};

struct incise_smooth {
	struct incise_predict fresh, predict;
	double period_s, pull[3]; /* of λ on velocity, for a noise of 1 */
	double noise_1_s;	  /* of the velocity, for a noise of 1 mm of positions */
	size_t lag, capacity;
	struct incise_smooth_record *records;
	size_t n, forward, finished,
		taken; /* records added, filtered, smoothed, returned */
	bool ended;
};

/*
 * Noise of the slope of a line through so many records to each side, less the smoother's
 * velocity, for a noise of 1 mm of positions; 1/s.
 */
double incise_smooth_line_noise(const struct incise_smooth *smooth, int half);

/* For records at this rate. Returns 0 or -ENOMEM. */
int incise_smooth_init(struct incise_smooth *smooth, double rate_hz);
void incise_smooth_free(struct incise_smooth *smooth);

/* Add a record, later than the one before; then take the finished ones. */
void incise_smooth_push(struct incise_smooth *smooth,
			const struct incise_smooth_record *record);

/* No more records follow. */
void incise_smooth_end(struct incise_smooth *smooth);

/* The next finished record, valid until the next push; NULL: none now. */
const struct incise_smooth_record *incise_smooth_take(struct incise_smooth *smooth);

/* --- progress of a cut --------------------------------------------------------------- */

/*
 * Whether the blade advances: it goes deeper than ever before in its cut, or along the skin into
 * new tissue; see ../../tissue/front.proto.c. Its progress is the depth and the length of the cut in
 * the skin,
 *
 *     progress      ,-----.      ,----
 *              ,---'       `.  ,'         highest so far, less the noise of a difference
 *     ________/              `'           of two depths
 *     advances ▔▔▔▔▔▔▔▔         ▔▔▔▔▔
 *
 * and it advances where that rises, and is at its highest. Both at 95 %: noise alone passes for
 * a rise in one record of 40. The line of the cut leads to its farthest point; 1 mm beside it
 * tissue is new.
 *
 * A blade that comes out on a slant meets new tissue too, but the work that was put in is given
 * back and ends before the surface. Of a force that grows by no more than the square of the
 * depth, all but INCISE_FRONT_KEPT is back at the cube root of that share of the deepest
 * depth: 0.4 of it. Nothing that is less deep counts as advancing.
 *
 * Starts with {0} and the surface's normal.
 */
struct incise_progress {
	double normal[3]; /* unit, out of the tissue */
	bool inside, has_line;
	double at_mm[3], along[3]; /* on the surface: start, and then the direction */
	double from_mm,
		to_mm; /* of the line; of one without direction, 0 and its radius */
	double way_mm; /* of new tissue */
	double highest_mm, deepest_mm; /* progress and depth so far */
};

/*
 * Add a finished record of the smoother; @noise_1_s is the smoother's. Returns whether the blade
 * advances there. Without a known noise there is none.
 */
bool incise_progress_add(struct incise_progress *progress,
			 const struct incise_smooth_record *record, double noise_1_s);

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
	struct incise_progress progress;
	struct incise_stay stay;
	struct incise_loop_motion loop;
};

/* NAN: not known. */
struct incise_blade_pose_value {
	double position_mm[3], position_u_mm, q[4];
	double depth_mm, depth_u_mm, velocity_mm_s;
	/* As in the haptic loop; see ../../control/model_input.h. Outside of tissue the time is 0. */
	double acceleration_mm_s2, tilt_deg, time_in_tissue_s;
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
