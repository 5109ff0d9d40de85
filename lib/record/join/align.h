/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Alignment of two clocks by marks that both recorded: knocks ("taps") in force or motion, or
 * events of a common line, which may be steps of the force in another recording.
 *
 *     force, N        ____│\____________│\__      onset: where it starts to rise
 *     position, mm    ___/▔▔▔          /▔▔▔       corner: where the speed jumps
 *
 * Marks of two clocks are matched by their intervals, so several taps in an irregular rhythm are
 * unambiguous. Times are ns of each recording's clock.
 */
#ifndef INCISE_ALIGN_H
#define INCISE_ALIGN_H

#include <stdint.h>
#include <incise/error.h>
#include <incise/session.h>
#include "../read/recording.h"

#define INCISE_MARKS_MAX 200

/* Two quartz clocks that nothing disciplines are this far apart at most. */
#define INCISE_ALIGN_RATE_MAX 1e-4

struct incise_mark {
	int64_t t_ns;
	double sd_ns;
};

/*
 * Find the marks of a recording, in order: at most INCISE_MARKS_MAX. Returns their number, 0
 * without any, -errno.
 */
int incise_align_marks(struct incise_recording *recording,
		       enum incise_session_align align,
		       struct incise_mark marks[INCISE_MARKS_MAX],
		       struct incise_error *err);

/* t_a = at_ns + offset_ns + (t_b - at_ns) · (1 + rate). */
struct incise_align_fit {
	int matches;
	int64_t at_ns; /* of clock b; about the middle of the marks */
	int64_t offset_ns;
	double rate, offset_sd_ns,
		rate_sd; /* rate 0 if it is not known; then its sd is NAN */
};

/*
 * Match and fit. Returns 0; -ENODATA (fewer than three match), -EDOM (ambiguous, or they may match
 * by chance), with a message. Events of a line may be steady; taps must not be.
 */
int incise_align_fit(const struct incise_mark *a, int n_a, const struct incise_mark *b,
		     int n_b, enum incise_session_align align,
		     struct incise_align_fit *fit, struct incise_error *err);

/* Time of clock b on clock a, and the bound of its error: 4 standard deviations. */
int64_t incise_align_time(const struct incise_align_fit *fit, int64_t t_ns,
			  double *bound_ns);

#endif
