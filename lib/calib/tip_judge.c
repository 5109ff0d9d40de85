// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Whether to believe a pivot calibration.
 *
 * A part of one noun: tests/unit/calib/tip.c tests it through its door.
 */
#include <errno.h>
#include "tip.h"

#define OUTLIERS_MAX 0.3
#define RMS_MAX_MM 1.0
#define CHI2_MOVED 16.27 /* of three, which chance exceeds once in 1000 */
#define MOVED_MIN_MM 0.1

/* Whether those left out lie together at an end: the pivot moved there. */
static bool outliers_at_end(const struct tip_poses *poses)
{
	int outliers = 0, late = 0;

	for (int i = 0; i < poses->n; i++)
		if (!poses->in[i]) {
			outliers++;
			late += i >= poses->n / 2;
		}
	return late > 0.8 * outliers || late < 0.2 * outliers;
}

int tip_judge(const struct tip_poses *poses, const struct incise_tip_fit *fit,
	      double chi2, struct incise_error *err)
{
	if (fit->least_deg < INCISE_TIP_LEAST_DEG)
		return incise_error_set(
			err, EDOM,
			"it turned about one axis only: the direction (%.2f %.2f %.2f) "
			"of the sensor swept %.0f degrees; turn the tool all ways",
			fit->least[0], fit->least[1], fit->least[2], fit->least_deg);
	if (fit->n - fit->inliers > OUTLIERS_MAX * fit->n) {
		if (outliers_at_end(poses))
			return incise_error_set(
				err, EDOM,
				"the pivot moved: %d of %d poses are about another point "
				"than the rest; keep the tip in its dimple",
				fit->n - fit->inliers, fit->n);
		return incise_error_set(
			err, EDOM,
			"%d of %d poses are not about the pivot of the others; keep the "
			"tip in its dimple, or are columns swapped?",
			fit->n - fit->inliers, fit->n);
	}
	if (fit->rms_mm > RMS_MAX_MM)
		return incise_error_set(
			err, EDOM,
			"poses miss their pivot by %.2f mm rms, more than %g mm; keep the "
			"tip in its dimple, or are columns swapped (quaternion w first)?",
			fit->rms_mm, RMS_MAX_MM);
	if (fit->cone_deg < INCISE_TIP_CONE_DEG)
		return incise_error_set(
			err, EDOM,
			"the tool swept a cone of %.0f degrees only; %g are needed",
			fit->cone_deg, INCISE_TIP_CONE_DEG);
	if (chi2 > CHI2_MOVED && fit->moved_mm > MOVED_MIN_MM)
		return incise_error_set(
			err, EDOM,
			"the pivot moved by %.2f mm while it turned; keep the tip in its "
			"dimple, and the dimple where it is",
			fit->moved_mm);
	if (fit->blocks < INCISE_TIP_POSES_MIN)
		return incise_error_set(
			err, EDOM,
			"%d poses are worth %d independent ones, %d are needed; turn the "
			"tool longer",
			fit->n, fit->blocks, INCISE_TIP_POSES_MIN);
	return 0;
}
