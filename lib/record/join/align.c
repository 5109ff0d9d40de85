// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Alignment of two clocks by common marks; see align.h.
 */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include "../../base/vector.h"
#include "../read/rows.h"
#include "align.h"

#define APART_NS 150000000LL /* two taps of a hand are further apart */
#define RISE_NS 2000000LL    /* a knock rises within this time */
#define RISE_ROWS 64	     /* of it that are kept */
#define LARGER 1.25	     /* then it is the mark; the end of a short pulse is not */
#define SHARE 0.3	     /* of the largest: smaller ones are no taps */
#define NOISES 8	     /* standard deviations that a tap exceeds */
#define SYNC_SD_NS 1000	     /* of an event of a common line: latency of an interrupt */
#define BOUND_SDS 4	     /* a normal error exceeds 4 of them once in 16000 */
#define MATCHES_MIN 3	     /* two marks have one interval, which is no rhythm */
#define CHANCE_MAX 1e-3 /* of a wrong alignment, for marks that have nothing in common */

/* --- marks of a recording ------------------------------------------------------------ */

/* A signal of how sudden something is, a value for each row. */
struct sudden {
	int64_t t_ns; /* of what the value shows */
	double value; /* at least 0 */
	double sd_ns;
};

/* A row of the table into the signal; false: no value yet. */
typedef bool (*sudden_at)(void *state, const struct incise_rows *rows, struct sudden *to);

/* Force: its change within RISE_NS. The onset is the row before the change started. */
struct rise {
	struct {
		int64_t t_ns, code;
	} rows[RISE_ROWS];
	int n;
};

static bool force_sudden(void *state, const struct incise_rows *rows, struct sudden *to)
{
	struct rise *rise = state;
	int64_t code = incise_rows_int(rows, 2);
	int from = 0;

	if (rise->n == RISE_ROWS)
		memmove(rise->rows, rise->rows + 1, --rise->n * sizeof(*rise->rows));
	rise->rows[rise->n].t_ns = rows->t_ns;
	rise->rows[rise->n++].code = code;
	while (rise->rows[from].t_ns < rows->t_ns - RISE_NS)
		from++;
	if (from == rise->n - 1)
		from = rise->n > 1 ? rise->n - 2 : 0;
	to->value = fabs((double)(code - rise->rows[from].code));
	/* The edge: the first half of the change. */
	to->t_ns = rows->t_ns;
	for (int i = from; i < rise->n; i++)
		if (fabs((double)(rise->rows[i].code - rise->rows[from].code)) >=
		    0.5 * to->value) {
			to->t_ns =
				i > from ? (rise->rows[i - 1].t_ns + rise->rows[i].t_ns) /
						   2
					 : rise->rows[i].t_ns;
			to->sd_ns = i > from ? (double)(rise->rows[i].t_ns -
							rise->rows[i - 1].t_ns)
					     : 0;
			break;
		}
	return rise->n > 1;
}

/* Motion: the change of the velocity at a row, by the rows before and after. */
struct bend {
	int64_t t_ns[3];
	double position_mm[3][3];
	int n;
};

static bool tracker_sudden(void *state, const struct incise_rows *rows, struct sudden *to)
{
	struct bend *bend = state;
	double before_s, after_s, sum = 0;

	if (!incise_pose_usable(incise_rows_char(rows, 5))) {
		bend->n = 0;
		return false;
	}
	if (bend->n == 3) {
		memmove(bend->t_ns, bend->t_ns + 1, 2 * sizeof(*bend->t_ns));
		memmove(bend->position_mm, bend->position_mm + 1,
			2 * sizeof(*bend->position_mm));
		bend->n = 2;
	}
	bend->t_ns[bend->n] = rows->t_ns;
	for (int i = 0; i < 3; i++)
		bend->position_mm[bend->n][i] = incise_rows_real(rows, 2 + i);
	if (++bend->n < 3)
		return false;
	before_s = (double)(bend->t_ns[1] - bend->t_ns[0]) * 1e-9;
	after_s = (double)(bend->t_ns[2] - bend->t_ns[1]) * 1e-9;
	if (before_s > 0.05 || after_s > 0.05)
		return false;
	for (int i = 0; i < 3; i++) {
		double v0 =
			(bend->position_mm[1][i] - bend->position_mm[0][i]) / before_s;
		double v1 = (bend->position_mm[2][i] - bend->position_mm[1][i]) / after_s;

		sum += (v1 - v0) * (v1 - v0);
	}
	to->t_ns = bend->t_ns[1];
	to->value = sqrt(sum);
	to->sd_ns = 0.25e9 * (before_s + after_s);
	return true;
}

struct align_walk {
	const char *table, *columns;
	sudden_at at;
	void *state;
	size_t size;   /* of it */
	bool centroid; /* the mark lies between the values around the largest */
};

/* The largest value, and the typical one. */
static int find_scale(struct incise_recording *recording, const struct align_walk *walk,
		      double *largest, double *noise, struct incise_error *err)
{
	struct incise_rows rows;
	struct sudden sudden;
	double sum = 0, n = 0;
	int rc = incise_rows_open(&rows, recording, walk->table, walk->columns,
				  UINT64_MAX, err);

	memset(walk->state, 0, walk->size);
	*largest = 0;
	while (!rc && (rc = incise_rows_next(&rows, err)) > 0) {
		rc = 0;
		if (!walk->at(walk->state, &rows, &sudden))
			continue;
		*largest = fmax(*largest, sudden.value);
		sum += sudden.value;
		n++;
	}
	incise_rows_close(&rows);
	/* The mean of a magnitude is 0.8 standard deviations. */
	*noise = n > 0 ? sum / n / 0.8 : 0;
	return rc;
}

/* The last three values, for a mark between them. */
static void mark_of(const struct sudden last[3], bool centroid, struct incise_mark *mark)
{
	double weight = 0, sum = 0;

	*mark = (struct incise_mark){last[1].t_ns, last[1].sd_ns};
	if (!centroid)
		return;
	for (int i = 0; i < 3; i++) {
		weight += last[i].value;
		sum += last[i].value * (double)(last[i].t_ns - last[1].t_ns);
	}
	if (weight > 0)
		mark->t_ns += llrint(sum / weight);
}

static int find_marks(struct incise_recording *recording, const struct align_walk *walk,
		      struct incise_mark marks[INCISE_MARKS_MAX],
		      struct incise_error *err)
{
	struct sudden last[3] = {{0}}, peak[3] = {{0}};
	struct incise_rows rows;
	double largest, noise, limit;
	int rc = find_scale(recording, walk, &largest, &noise, err), n = 0;
	bool in = false;

	limit = fmax(NOISES * noise, SHARE * largest);
	if (rc || !(largest > 0) || largest < limit)
		return rc;
	rc = incise_rows_open(&rows, recording, walk->table, walk->columns, UINT64_MAX,
			      err);
	memset(walk->state, 0, walk->size);
	while (!rc && (rc = incise_rows_next(&rows, err)) > 0) {
		rc = 0;
		memmove(last, last + 1, 2 * sizeof(*last));
		if (!walk->at(walk->state, &rows, &last[2]))
			continue;
		/* The value before is a local peak, or the first above the limit. */
		if (last[1].value >= limit && last[1].value >= last[2].value &&
		    last[1].value > last[0].value &&
		    (!in || last[1].t_ns - peak[1].t_ns < APART_NS) &&
		    (!in || last[1].value > LARGER * peak[1].value)) {
			if (!in && n == INCISE_MARKS_MAX)
				break;
			memcpy(peak, last, sizeof(peak));
			mark_of(peak, walk->centroid, &marks[in ? n - 1 : n]);
			n += !in;
			in = true;
		}
		in = in && last[2].t_ns - peak[1].t_ns < APART_NS;
	}
	incise_rows_close(&rows);
	return rc ? rc : n;
}

/* The events of a kind. */
static int find_events(struct incise_recording *recording,
		       struct incise_mark marks[INCISE_MARKS_MAX],
		       struct incise_error *err)
{
	struct incise_rows rows;
	int rc = incise_rows_open(&rows, recording, "events", "rowid, t_ns, kind",
				  UINT64_MAX, err),
	    n = 0;

	while (!rc && (rc = incise_rows_next(&rows, err)) > 0) {
		rc = 0;
		if (!strcmp(incise_rows_text(&rows, 2, NULL), "sync") &&
		    n < INCISE_MARKS_MAX)
			marks[n++] = (struct incise_mark){rows.t_ns, SYNC_SD_NS};
	}
	incise_rows_close(&rows);
	return rc ? rc : n;
}

int incise_align_marks(struct incise_recording *recording,
		       enum incise_session_align align,
		       struct incise_mark marks[INCISE_MARKS_MAX],
		       struct incise_error *err)
{
	struct rise rise;
	struct bend bend;
	const struct align_walk force = {"force", "seq, t_ns, code", force_sudden,
					 &rise,	  sizeof(rise),	     false};
	const struct align_walk tracker = {
		"tracker",	"seq, t_ns, x_mm, y_mm, z_mm, status",
		tracker_sudden, &bend,
		sizeof(bend),	true};
	int n;

	if (align == INCISE_ALIGN_EVENTS)
		return find_events(recording, marks, err);
	n = recording->meta.force ? find_marks(recording, &force, marks, err) : 0;
	return n ? n : find_marks(recording, &tracker, marks, err);
}

/* --- matching ------------------------------------------------------------------------ */

/* The largest distance of two marks that are one, where another pair gives the offset. */
static double tolerance(const struct incise_mark *a, const struct incise_mark *b,
			int64_t from_ns)
{
	return BOUND_SDS * hypot(a->sd_ns, b->sd_ns) +
	       INCISE_ALIGN_RATE_MAX * fabs((double)(b->t_ns - from_ns)) + 1;
}

/* The mark of a that belongs to one of b; -1: none. */
static int partner(const struct incise_mark *a, int n_a, const struct incise_mark *b,
		   int64_t offset_ns, int64_t from_ns)
{
	int best = -1;

	for (int i = 0; i < n_a; i++) {
		double far = fabs((double)(a[i].t_ns - b->t_ns - offset_ns));

		if (far <= tolerance(&a[i], b, from_ns) &&
		    (best < 0 ||
		     far < fabs((double)(a[best].t_ns - b->t_ns - offset_ns))))
			best = i;
	}
	return best;
}

/* Count the marks of b with a partner; @inside: all between a's first and last mark. */
static int count_align(const struct incise_mark *a, int n_a, const struct incise_mark *b,
		       int n_b, int64_t offset_ns, int64_t from_ns, int *inside)
{
	int n = 0;

	*inside = 0;
	for (int k = 0; k < n_b; k++) {
		int64_t t_ns = b[k].t_ns + offset_ns;
		bool has = partner(a, n_a, &b[k], offset_ns, from_ns) >= 0;

		n += has;
		*inside += has || (t_ns >= a[0].t_ns && t_ns <= a[n_a - 1].t_ns);
	}
	return n;
}

/* An offset that puts a mark of b on one of a. */
struct found {
	int64_t offset_ns, from_ns;
	int n, inside;
	int second;	/* the most matches of other offsets */
	double typical; /* share of marks that other offsets match */
};

/* The pair whose offset matches most marks, next to the other offsets. */
static void match(const struct incise_mark *a, int n_a, const struct incise_mark *b,
		  int n_b, struct found *found)
{
	double wide = 0, matched = 0, inside = 0;
	int n, in;

	*found = (struct found){0};
	for (int i = 0; i < n_a; i++)
		for (int k = 0; k < n_b; k++) {
			int64_t offset = a[i].t_ns - b[k].t_ns;

			n = count_align(a, n_a, b, n_b, offset, b[k].t_ns, &in);
			if (n <= found->n)
				continue;
			*found = (struct found){offset, b[k].t_ns, n, in, 0, 0};
		}
	for (int k = 0; k < n_b; k++)
		wide = fmax(wide, tolerance(&a[0], &b[k], found->from_ns));
	for (int i = 0; i < n_a; i++)
		for (int k = 0; k < n_b; k++) {
			int64_t offset = a[i].t_ns - b[k].t_ns;

			if (fabs((double)(offset - found->offset_ns)) <= 2 * wide)
				continue;
			n = count_align(a, n_a, b, n_b, offset, b[k].t_ns, &in);
			found->second = n > found->second ? n : found->second;
			/* Without the pair that makes the offset. */
			matched += n - 1;
			inside += in - 1;
		}
	found->typical = inside > 0 ? matched / inside : 0;
}

/*
 * The expected number of offsets that match so many marks if nothing is common: each mark but the
 * pair that makes the offset finds one of a within its tolerance, at a's mean density or as often
 * as at the other offsets.
 */
static double by_chance(const struct incise_mark *a, int n_a, const struct incise_mark *b,
			int n_b, const struct found *found, double typical)
{
	double probability[INCISE_MARKS_MAX + 1] = {1}, sum = 0;
	double density = n_a / fmax(1, (double)(a[n_a - 1].t_ns - a[0].t_ns));
	int n = 0;

	for (int k = 0; k < n_b; k++) {
		int64_t t_ns = b[k].t_ns + found->offset_ns;
		double p = 0;

		if (b[k].t_ns == found->from_ns ||
		    (partner(a, n_a, &b[k], found->offset_ns, found->from_ns) < 0 &&
		     (t_ns < a[0].t_ns || t_ns > a[n_a - 1].t_ns)))
			continue;
		for (int i = 0; i < n_a; i++)
			p += 2 * density * tolerance(&a[i], &b[k], found->from_ns) / n_a;
		p = fmin(1, fmax(p, typical));
		for (int j = ++n; j > 0; j--)
			probability[j] =
				probability[j] * (1 - p) + probability[j - 1] * p;
		probability[0] *= 1 - p;
	}
	for (int j = found->n - 1; j <= n; j++)
		sum += probability[j];
	return sum * n_a * n_b;
}

/* Weighted straight line through the matched marks. */
static void fit_align_line(const struct incise_mark *a, int n_a,
			   const struct incise_mark *b, int n_b, int64_t offset_ns,
			   int64_t from_ns, struct incise_align_fit *fit)
{
	double w = 0, x = 0, y = 0, xx = 0, xy = 0, residual = 0, mean_x, mean_y;
	int n = 0;

	for (int pass = 0; pass < 2; pass++)
		for (int k = 0; k < n_b; k++) {
			int i = partner(a, n_a, &b[k], offset_ns, from_ns);
			double dx = (double)(b[k].t_ns - from_ns), dy, weight, variance;

			if (i < 0)
				continue;
			variance = a[i].sd_ns * a[i].sd_ns + b[k].sd_ns * b[k].sd_ns + 1;
			weight = 1 / variance;
			dy = (double)(a[i].t_ns - b[k].t_ns - offset_ns);
			if (!pass) {
				w += weight;
				x += weight * dx;
				y += weight * dy;
				n++;
				continue;
			}
			dx -= x / w;
			dy -= y / w;
			xx += weight * dx * dx;
			xy += weight * dx * dy;
		}
	mean_x = x / w;
	mean_y = y / w;
	*fit = (struct incise_align_fit){
		.matches = n,
		.at_ns = from_ns + llrint(mean_x),
		.offset_ns = offset_ns + llrint(mean_y),
		.offset_sd_ns = 1 / sqrt(w),
		.rate_sd = NAN,
	};
	/* A rate that the marks show better than what is known of quartz clocks. */
	if (n < 3 || !(xx > 0) || 1 / sqrt(xx) > INCISE_ALIGN_RATE_MAX / BOUND_SDS)
		return;
	fit->rate = xy / xx;
	fit->rate_sd = 1 / sqrt(xx);
	for (int k = 0; k < n_b; k++) {
		int i = partner(a, n_a, &b[k], offset_ns, from_ns);
		double dy, variance;

		if (i < 0)
			continue;
		variance = a[i].sd_ns * a[i].sd_ns + b[k].sd_ns * b[k].sd_ns + 1;
		dy = (double)(a[i].t_ns - b[k].t_ns - offset_ns) - mean_y -
		     fit->rate * ((double)(b[k].t_ns - from_ns) - mean_x);
		residual += dy * dy / variance;
	}
	/* Marks that scatter more than their uncertainty says are so uncertain. */
	residual = sqrt(fmax(1, residual / fmax(1, n - 2)));
	fit->offset_sd_ns *= residual;
	fit->rate_sd *= residual;
	/* No two clocks differ so much, but the estimate may: then it says nothing. */
	if (fabs(fit->rate) > INCISE_ALIGN_RATE_MAX &&
	    fabs(fit->rate) - BOUND_SDS * fit->rate_sd <= INCISE_ALIGN_RATE_MAX) {
		fit->rate = 0;
		fit->rate_sd = NAN;
	}
}

#define TAP_AGAIN "tap at least three times in an irregular rhythm"

int incise_align_fit(const struct incise_mark *a, int n_a, const struct incise_mark *b,
		     int n_b, enum incise_session_align align,
		     struct incise_align_fit *fit, struct incise_error *err)
{
	struct found found = {0};
	double expected;
	int back, inside;

	if (n_a && n_b)
		match(a, n_a, b, n_b, &found);
	if (found.n < MATCHES_MIN)
		return incise_error_set(
			err, ENODATA, "%d and %d marks, and no %d in common; " TAP_AGAIN,
			n_a, n_b, MATCHES_MIN);
	if (found.second >= found.n)
		return incise_error_set(
			err, EDOM,
			"%d and %d marks match at more than one offset; " TAP_AGAIN, n_a,
			n_b);
	back = count_align(b, n_b, a, n_a, -found.offset_ns,
			   found.from_ns + found.offset_ns, &inside);
	if (2 * found.n <= found.inside || 2 * back <= inside)
		return incise_error_set(
			err, EDOM,
			"of %d and %d marks in their overlap only %d match, as by "
			"chance; " TAP_AGAIN ", harder than anything else",
			inside, found.inside, back < found.n ? back : found.n);
	expected = by_chance(a, n_a, b, n_b, &found,
			     align == INCISE_ALIGN_TAP ? found.typical : 0);
	if (expected > CHANCE_MAX)
		return incise_error_set(
			err, EDOM,
			"%d marks match, and would by chance with a probability of up to "
			"%.2g; tap more often, in an irregular rhythm",
			found.n, fmin(1, expected));
	fit_align_line(a, n_a, b, n_b, found.offset_ns, found.from_ns, fit);
	if (fabs(fit->rate) > INCISE_ALIGN_RATE_MAX)
		return incise_error_set(
			err, EDOM,
			"their marks differ in rate by %.4g ppm, more than the clocks of any "
			"two machines (%g ppm), so they match by chance; " TAP_AGAIN,
			1e6 * fit->rate, 1e6 * INCISE_ALIGN_RATE_MAX);
	return 0;
}

int64_t incise_align_time(const struct incise_align_fit *fit, int64_t t_ns,
			  double *bound_ns)
{
	double far = (double)(t_ns - fit->at_ns);
	double sd = isnan(fit->rate_sd) ? 0 : fit->rate_sd * far;

	*bound_ns = BOUND_SDS * hypot(fit->offset_sd_ns, sd) +
		    (isnan(fit->rate_sd) ? INCISE_ALIGN_RATE_MAX * fabs(far) : 0);
	return t_ns + fit->offset_ns + llrint(fit->rate * far);
}
