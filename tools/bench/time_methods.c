// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Ways of telling when samples were taken; see time_methods.h.
 *
 *     y │  ·    ·      ·  ·         y: arrival less number · nominal period
 *       │----·-------·---·----      least squares: through the middle of the arrivals
 *       │ ·    ·  ·  ·              lowest: level, below all
 *       │__·____·___________·_      the library's: sloping, below all
 *       └──────────────────► number
 */
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include "../../lib/record/time/timeline.h"
#include "../cli/cli.h"
#include "drifting_stream.h"
#include "time_methods.h"

#define PERIOD_NS (1e9 / STREAM_HZ)

static void *room(size_t size)
{
	void *memory = calloc(1, size);

	if (!memory)
		cli_fail("no memory");
	return memory;
}

/* ---- arrivals as they are, and above the lowest of them ---- */

static void *none_begin(const struct drifting_stream *stream)
{
	(void)stream;
	return NULL;
}

static double arrival_take(void *state, uint64_t seq, int64_t arrival_ns)
{
	(void)state;
	(void)seq;
	return (double)(arrival_ns - STREAM_DELAY_NS);
}

static void none_end(void *state)
{
	(void)state;
}

struct lowest {
	bool begun;
	uint64_t seq;
	int64_t arrival_ns; /* of the lowest */
};

static void *lowest_begin(const struct drifting_stream *stream)
{
	(void)stream;
	return room(sizeof(struct lowest));
}

static double lowest_take(void *state, uint64_t seq, int64_t arrival_ns)
{
	struct lowest *lowest = state;
	double x_ns = (double)(seq - lowest->seq) * PERIOD_NS;

	if (!lowest->begun || (double)(arrival_ns - lowest->arrival_ns) < x_ns) {
		*lowest = (struct lowest){true, seq, arrival_ns};
		x_ns = 0;
	}
	return (double)(lowest->arrival_ns - STREAM_DELAY_NS) + x_ns;
}

/* ---- least squares of all arrivals ---- */

/* Means and sums about them, which grow without losing digits: Welford's. */
struct squares {
	uint64_t first;
	int64_t first_ns;
	double n, x, y, xx, xy; /* y: ns later than the nominal period says */
	double late_ns;
};

static void *squares_begin(const struct drifting_stream *stream)
{
	(void)stream;
	return room(sizeof(struct squares));
}

static void *squares_known_begin(const struct drifting_stream *stream)
{
	struct squares *s = room(sizeof(*s));

	s->late_ns = stream->mean_late_ns;
	return s;
}

static double squares_at(const void *state, uint64_t seq)
{
	const struct squares *s = state;
	double x_ns = (double)(seq - s->first) * PERIOD_NS;
	double slope = s->xx > 0 ? s->xy / s->xx : 0;

	return (double)(s->first_ns - STREAM_DELAY_NS) + x_ns + s->y +
	       slope * (x_ns - s->x) - s->late_ns;
}

static double squares_take(void *state, uint64_t seq, int64_t arrival_ns)
{
	struct squares *s = state;
	double x_ns, y_ns, dx, dy;

	if (!s->n) {
		s->first = seq;
		s->first_ns = arrival_ns;
	}
	x_ns = (double)(seq - s->first) * PERIOD_NS;
	y_ns = (double)(arrival_ns - s->first_ns) - x_ns;
	s->n++;
	dx = x_ns - s->x;
	dy = y_ns - s->y;
	s->x += dx / s->n;
	s->y += dy / s->n;
	s->xx += dx * (x_ns - s->x);
	s->xy += dx * (y_ns - s->y);
	return squares_at(s, seq);
}

/* ---- the library ---- */

struct line {
	struct incise_timeline timeline;
	int n;
	struct incise_timeline_knot knots[INCISE_TIMELINE_KNOTS_MAX];
};

static void *line_of_grain(int64_t grain_ns)
{
	struct line *line = room(sizeof(*line));

	incise_timeline_init(&line->timeline, &(struct incise_timeline_setup){
						      .rate_hz = STREAM_HZ,
						      .delay_ns = STREAM_DELAY_NS,
						      .grain_ns = grain_ns,
					      });
	return line;
}

static void *line_begin(const struct drifting_stream *stream)
{
	return line_of_grain(stream->grain_ns);
}

static void *untold_begin(const struct drifting_stream *stream)
{
	(void)stream;
	return line_of_grain(0);
}

static double line_take(void *state, uint64_t seq, int64_t arrival_ns)
{
	struct line *line = state;

	return (double)incise_timeline_sample(&line->timeline, seq, arrival_ns);
}

static double line_live_sd(const void *state, uint64_t seq)
{
	const struct line *line = state;
	struct incise_timeline_report report;

	(void)seq;
	incise_timeline_report(&line->timeline, &report);
	return report.offset_sd_ns;
}

static void line_finish(void *state)
{
	struct line *line = state;

	line->n = incise_timeline_knots(&line->timeline, line->knots);
}

static double line_at(const void *state, uint64_t seq)
{
	const struct line *line = state;

	return line->n ? (double)incise_timeline_at(line->knots, line->n, seq) : NAN;
}

static double line_final_sd(const void *state, uint64_t seq)
{
	const struct line *line = state;

	return line->n ? incise_timeline_sd(line->knots, line->n, seq) : NAN;
}

const struct time_method time_methods[TIME_METHODS] = {
	{"arrival", none_begin, arrival_take, NULL, NULL, NULL, none_end},
	{"lowest", lowest_begin, lowest_take, NULL, NULL, NULL, free},
	{"squares", squares_begin, squares_take, NULL, NULL, NULL, free},
	{"squares_known", squares_known_begin, squares_take, NULL, NULL, NULL, free},
	{"squares_final", squares_known_begin, squares_take, squares_at, NULL, NULL,
	 free},
	{"line_live", line_begin, line_take, NULL, NULL, line_live_sd, free},
	{"line_untold", untold_begin, line_take, NULL, NULL, line_live_sd, free},
	{"line_final", line_begin, line_take, line_at, line_finish, line_final_sd, free},
};
