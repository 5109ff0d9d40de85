// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * error of the pose that the loop is given, over the tracker's rate and
 * delay.
 *
 *   true      ────────────────────────────────────────
 *   poses       |       |       x       |                x: lost
 *   arrivals     ·─4ms─▶|       |               |
 *   ticks     | | | | | | | | | | | | | | | | | | |
 *                       '─ age of the last pose: 4 ms … a period more
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/clock.h>
#include "../../lib/sim/sim.h"
#include <incise/tracker.h>
#include "../../lib/base/vector.h"
#include "../../lib/control/predict.h"
#include "program.h"
#include "noise.h"

#define TICKS 16000
#define QUICK_TICKS 3500

static const double rates_hz[] = {60, 120, 240, 1000};
static const double delays_ms[] = {4, 12};
static const double gaps_ms[] = {25, 50, 100, 200, 500};

/* Losses are measured at these, and metrics are of them. */
#define USUAL_HZ 120
#define USUAL_MS 4

/* --- motions whose truth is known at any time ---
 *
 *   line      ╱        30 mm/s, for ever
 *   tremor    ∿∿∿∿     ±0.1 mm at 8, 10 and 12 Hz, one on each axis
 *   stroke    ╭─╮_╭─   40 mm and back, 10 mm deep, up to 94 mm/s; the hand leans
 *   surgeon            two cuts of the virtual rig, with its tremor
 */

struct state {
	double position_mm[3], velocity_mm_s[3];
	double quaternion[4]; /* unit, w first */
};

/* A value and its slope. */
struct curve {
	double at, slope;
};

/* From 0 to 1 over u = 0 … 1 with the least jerk: Flash and Hogan, J. Neurosci. 5, 1985. */
static struct curve least_jerk(double u)
{
	double left = 1 - u;

	return (struct curve){u * u * u * (10 + u * (6 * u - 15)),
			      30 * u * u * left * left};
}

/* About an axis by an angle. */
static void lean(struct state *state, int axis, double angle)
{
	state->quaternion[0] = cos(angle / 2);
	state->quaternion[1 + axis] = sin(angle / 2);
}

static void line_motion(double t_s, struct state *state)
{
	state->position_mm[0] = 30 * t_s;
	state->velocity_mm_s[0] = 30;
}

static void tremor_motion(double t_s, struct state *state)
{
	for (int i = 0; i < 3; i++) {
		double w = 2 * M_PI * (8 + 2 * i);

		state->position_mm[i] = 0.1 * sin(w * t_s + i);
		state->velocity_mm_s[i] = 0.1 * w * cos(w * t_s + i);
	}
	lean(state, 0, 0.5 * M_PI / 180 * sin(2 * M_PI * 10 * t_s));
}

/* Each way takes 0.8 s, and 0.2 s of rest. */
static void stroke_motion(double t_s, struct state *state)
{
	double within = fmod(t_s, 2), back = within >= 1;
	double u = fmin((within - back) / 0.8, 1);
	struct curve way = least_jerk(u);

	way.slope /= 0.8;
	if (back > 0)
		way = (struct curve){1 - way.at, -way.slope};
	state->position_mm[0] = 40 * way.at;
	state->velocity_mm_s[0] = 40 * way.slope;
	state->position_mm[2] = -10 * pow(sin(M_PI * way.at), 2);
	state->velocity_mm_s[2] = -10 * M_PI * sin(2 * M_PI * way.at) * way.slope;
	lean(state, 1, 0.3 * way.at);
}

static const struct motion {
	const char *name;
	void (*at)(double t_s, struct state *state); /* NULL: the virtual surgeon's */
} motions[] = {
	{"line", line_motion},
	{"tremor", tremor_motion},
	{"stroke", stroke_motion},
	{"surgeon", NULL},
};
#define STROKE (&motions[2])

/* The rig has the place at a time that does not run back, and of the velocity its size: so
 * the vector is that of places a little before and after. */
#define ASIDE_NS 500

static void surgeon_states(const int64_t *t_ns, int n, struct state *states)
{
	struct incise_clock *clock = incise_clock_new_simulated(0);
	struct incise_error err = {0};
	struct incise_sim_config config;
	struct incise_sim *sim;

	incise_sim_config_init(&config);
	config.n_depths = 2;
	config.depth_mm[0] = 5;
	config.depth_mm[1] = 20;
	config.times[0] = config.times[1] = 1;
	sim = cli_require(clock ? incise_sim_new(&config, clock, &err) : NULL, &err);
	for (int k = 0; k < n; k++) {
		struct incise_sim_truth truth[3];

		for (int i = 0; i < 3; i++) {
			incise_clock_wait_until(clock, t_ns[k] + (i - 1) * ASIDE_NS);
			incise_sim_truth(sim, &truth[i]);
		}
		v3_copy(states[k].position_mm, truth[1].position_mm);
		for (int i = 0; i < 3; i++)
			states[k].velocity_mm_s[i] =
				(truth[2].position_mm[i] - truth[0].position_mm[i]) /
				(2 * ASIDE_NS * 1e-9);
		memcpy(states[k].quaternion, truth[1].quaternion,
		       sizeof(states[k].quaternion));
	}
	incise_sim_free(sim);
	incise_clock_free(clock);
}

/* At n times, each at least 1 us after the one before, and 1 ms or more. */
static void states_at(const struct motion *motion, const int64_t *t_ns, int n,
		      struct state *states)
{
	if (!motion->at) {
		surgeon_states(t_ns, n, states);
		return;
	}
	for (int k = 0; k < n; k++) {
		states[k] = (struct state){.quaternion = {1}};
		motion->at((double)t_ns[k] / INCISE_NS_PER_S, &states[k]);
	}
}

/* --- what a tracker sees of a motion --- */

/* A tracker adds to the truth: sd per axis, of the attitude about each axis, of a pose's
 * lateness, and the share that is lost. Its clock is a bit fast, so that all phases of its
 * period against the ticks occur. */
#define NOISE_MM 0.02
#define NOISE_DEG 0.025
#define JITTER_MS 0.2
#define LOST 0.01
#define DRIFT_PPM 50
#define SEED 20

/* Ticks are 1 ms apart; those of the first half second do not count. */
#define TICK_NS 1000000
#define BEGIN_TICKS 500
#define BEGIN_NS (100 * TICK_NS) /* all times before are above 0 */

/* Gaps begin so many ms after each other; error counts until a while after each. */
#define GAP_EVERY_MS 770
#define GAP_AFTER_MS 100

struct condition {
	const struct motion *motion;
	double tracker_hz, delay_ms;
	/* No pose comes for so long again and again, and none else is lost; NaN: no gaps. */
	double gap_ms;
	int ticks;
};

/* Poses of a tracker, and the truth at each tick. */
struct track {
	struct condition condition;
	struct incise_tracker_info info;
	struct incise_tracker_sample *samples; /* as they arrive */
	int n;
	int64_t *t_ns;	     /* of the ticks */
	struct state *truth; /* at the ticks */
	struct state *late;  /* the delay before them */
	double *age_s;	     /* of the last pose that had come */
	bool *counts;
};

static void times_quaternion(double q[4], const double by[4])
{
	const double a[4] = {q[0], q[1], q[2], q[3]};

	q[0] = a[0] * by[0] - a[1] * by[1] - a[2] * by[2] - a[3] * by[3];
	q[1] = a[0] * by[1] + a[1] * by[0] + a[2] * by[3] - a[3] * by[2];
	q[2] = a[0] * by[2] - a[1] * by[3] + a[2] * by[0] + a[3] * by[1];
	q[3] = a[0] * by[3] + a[1] * by[2] - a[2] * by[1] + a[3] * by[0];
}

static void disturb(const struct state *state, uint64_t *noise,
		    struct incise_tracker_sample *sample)
{
	double shake[4] = {1}, length = 1;

	for (int i = 0; i < 3; i++)
		sample->position_mm[i] =
			state->position_mm[i] + NOISE_MM * noise_normal(noise);
	for (int i = 1; i < 4; i++) {
		shake[i] = NOISE_DEG * M_PI / 360 * noise_normal(noise);
		length += shake[i] * shake[i];
	}
	for (int i = 0; i < 4; i++)
		shake[i] /= sqrt(length);
	memcpy(sample->quaternion, state->quaternion, sizeof(sample->quaternion));
	times_quaternion(sample->quaternion, shake);
}

/* Whether a gap began less than so long ago; they begin in the second second. */
static bool within_gap(int64_t t_ns, double ms)
{
	double gone_ms = (double)(t_ns - BEGIN_NS) * 1e-6 - 1000;

	return gone_ms >= 0 && fmod(gone_ms, GAP_EVERY_MS) < ms;
}

/* Poses as they arrive, none before the one before it; when each was true in taken_ns. */
static void take_poses(struct track *track, int64_t *taken_ns)
{
	const struct condition *c = &track->condition;
	double period_ns = INCISE_NS_PER_S / (c->tracker_hz * (1 + DRIFT_PPM * 1e-6));
	int all = (int)((double)c->ticks * TICK_NS / period_ns);
	struct state *states = cli_alloc(all, sizeof(*states));
	uint64_t noise = SEED;
	int64_t before_ns = 0;

	track->samples = cli_alloc(all + 1, sizeof(*track->samples));
	for (int k = 0; k < all; k++)
		taken_ns[k] = BEGIN_NS + llround(k * period_ns);
	states_at(c->motion, taken_ns, all, states);
	for (int k = 0; k < all; k++) {
		struct incise_tracker_sample *sample = &track->samples[track->n];
		double late_ms = c->delay_ms + JITTER_MS * fabs(noise_normal(&noise));
		bool lost = noise_uniform(&noise) < LOST;

		*sample = (struct incise_tracker_sample){
			.t_ns = taken_ns[k] + llround(late_ms * 1e6),
			.seq = (uint64_t)k,
			.status = ' ',
			.station = 1,
		};
		if (sample->t_ns <= before_ns)
			sample->t_ns = before_ns + 1;
		before_ns = sample->t_ns;
		disturb(&states[k], &noise, sample);
		if (c->gap_ms > 0 ? within_gap(sample->t_ns, c->gap_ms) : lost)
			continue;
		taken_ns[track->n++] = taken_ns[k];
	}
	free(states);
}

static void set_ticks(struct track *track, const int64_t *taken_ns)
{
	const struct condition *c = &track->condition;
	int64_t delay_ns = llround(c->delay_ms * 1e6),
		*before_ns = cli_alloc(c->ticks, sizeof(*before_ns));

	track->t_ns = cli_alloc(c->ticks, sizeof(*track->t_ns));
	track->truth = cli_alloc(c->ticks, sizeof(*track->truth));
	track->late = cli_alloc(c->ticks, sizeof(*track->late));
	track->age_s = cli_alloc(c->ticks, sizeof(*track->age_s));
	track->counts = cli_alloc(c->ticks, sizeof(*track->counts));
	for (int k = 0, come = 0; k < c->ticks; k++) {
		int64_t t_ns = BEGIN_NS + (int64_t)k * TICK_NS;

		while (come < track->n && track->samples[come].t_ns <= t_ns)
			come++;
		track->t_ns[k] = t_ns;
		before_ns[k] = t_ns - delay_ns;
		if (come)
			track->age_s[k] = (double)(t_ns - taken_ns[come - 1]) * 1e-9;
		track->counts[k] = c->gap_ms > 0
					   ? within_gap(t_ns, c->gap_ms + GAP_AFTER_MS)
					   : k >= BEGIN_TICKS;
	}
	states_at(c->motion, track->t_ns, c->ticks, track->truth);
	states_at(c->motion, before_ns, c->ticks, track->late);
	free(before_ns);
}

static struct track track_begin(const struct condition *c)
{
	int64_t *taken_ns = cli_alloc((size_t)c->ticks * 2, sizeof(*taken_ns));
	struct track track = {
		.condition = *c,
		.info = {.name = "bench",
			 .rate_hz = c->tracker_hz,
			 .latency_ns = llround(c->delay_ms * 1e6),
			 .stations = 1},
	};

	take_poses(&track, taken_ns);
	set_ticks(&track, taken_ns);
	free(taken_ns);
	return track;
}

static void track_end(struct track *track)
{
	free(track->samples);
	free(track->t_ns);
	free(track->truth);
	free(track->late);
	free(track->age_s);
	free(track->counts);
}

/* --- methods: the pose of now from poses that came before --- */

struct method {
	const char *name;
	/* Returns a state that free(3) releases. */
	void *(*start)(const struct incise_tracker_info *info);
	void (*add)(void *state, const struct incise_tracker_sample *sample);
	void (*at)(const void *state, int64_t t_ns, struct state *shown);
};

#define LAST 6

/* Position over time since the last pose, of each axis: x + v t + a t². The time between
 * poses is that of their numbers: arrivals of two are a jitter apart. */
struct last {
	double rate_hz;
	int64_t latency_ns, t_ns; /* acquisition of the last */
	uint64_t seq[LAST];	  /* the newest first */
	double position_mm[LAST][3];
	double quaternion[4];
	int n;
	double x[3], v[3], a[3];
};

static void *last_start(const struct incise_tracker_info *info)
{
	struct last *last = cli_alloc(1, sizeof(*last));

	last->rate_hz = info->rate_hz;
	last->latency_ns = info->latency_ns;
	last->quaternion[0] = 1;
	return last;
}

static void last_take(struct last *last, const struct incise_tracker_sample *sample,
		      int keep)
{
	memmove(last->seq + 1, last->seq, (keep - 1) * sizeof(*last->seq));
	memmove(last->position_mm + 1, last->position_mm,
		(keep - 1) * sizeof(*last->position_mm));
	last->seq[0] = sample->seq;
	v3_copy(last->position_mm[0], sample->position_mm);
	v3_copy(last->x, sample->position_mm);
	memcpy(last->quaternion, sample->quaternion, sizeof(last->quaternion));
	last->t_ns = sample->t_ns - last->latency_ns;
	last->n += last->n < keep;
}

static void held_add(void *state, const struct incise_tracker_sample *sample)
{
	last_take(state, sample, 1);
}

static void held_at(const void *state, int64_t t_ns, struct state *shown)
{
	const struct last *last = state;

	(void)t_ns;
	v3_copy(shown->position_mm, last->x);
	memset(shown->velocity_mm_s, 0, sizeof(shown->velocity_mm_s));
	memcpy(shown->quaternion, last->quaternion, sizeof(last->quaternion));
}

/* Least squares in time and its square, through the normal equations: six points in about
 * their own period are harmless. */
static void fit_add(void *state, const struct incise_tracker_sample *sample)
{
	struct last *last = state;
	double s[5] = {0}, m[3][6] = {{0}};

	last_take(last, sample, LAST);
	if (last->n < LAST)
		return;
	for (int k = 0; k < LAST; k++) {
		double u = -(double)(last->seq[0] - last->seq[k]), power = 1;

		for (int i = 0; i < 5; i++, power *= u) {
			s[i] += power;
			for (int axis = 0; i < 3 && axis < 3; axis++)
				m[i][3 + axis] += power * last->position_mm[k][axis];
		}
	}
	for (int i = 0; i < 3; i++)
		for (int j = 0; j < 3; j++)
			m[i][j] = s[i + j];
	/* The matrix is positive definite: no pivots are needed. */
	for (int i = 0; i < 3; i++)
		for (int row = 0; row < 3; row++) {
			double share = m[row][i] / m[i][i];

			for (int j = 0; row != i && j < 6; j++)
				m[row][j] -= share * m[i][j];
		}
	for (int axis = 0; axis < 3; axis++) {
		last->x[axis] = m[0][3 + axis] / m[0][0];
		last->v[axis] = m[1][3 + axis] / m[1][1] * last->rate_hz;
		last->a[axis] = m[2][3 + axis] / m[2][2] * last->rate_hz * last->rate_hz;
	}
}

static void last_at(const void *state, int64_t t_ns, struct state *shown)
{
	const struct last *last = state;
	double t_s = (double)(t_ns - last->t_ns) * (1.0 / INCISE_NS_PER_S);

	for (int i = 0; i < 3; i++) {
		shown->position_mm[i] =
			last->x[i] + (last->v[i] + last->a[i] * t_s) * t_s;
		shown->velocity_mm_s[i] = last->v[i] + 2 * last->a[i] * t_s;
	}
	memcpy(shown->quaternion, last->quaternion, sizeof(last->quaternion));
}

static void *library_start(const struct incise_tracker_info *info)
{
	struct incise_predict *predict = cli_alloc(1, sizeof(*predict));

	incise_predict_init(predict, info, 0);
	return predict;
}

static void library_add(void *state, const struct incise_tracker_sample *sample)
{
	incise_predict_add(state, sample);
}

static void library_at(const void *state, int64_t t_ns, struct state *shown)
{
	incise_predict_at(state, t_ns, shown->position_mm, shown->velocity_mm_s,
			  shown->quaternion);
}

static const struct method methods[] = {
	{"held", last_start, held_add, held_at},
	{"parabola", last_start, fit_add, last_at},
	{"library", library_start, library_add, library_at},
	{.name = "exact_delayed"}, /* the true pose of the delay before */
};

/* Its pose at each tick of a track. */
static void show(const struct track *track, const struct method *method,
		 struct state *shown)
{
	void *state = method->start(&track->info);
	int come = 0;

	for (int k = 0; k < track->condition.ticks; k++) {
		while (come < track->n && track->samples[come].t_ns <= track->t_ns[k])
			method->add(state, &track->samples[come++]);
		method->at(state, track->t_ns[k], &shown[k]);
	}
	free(state);
}

/* --- error --- */

struct norms {
	double rms, max;
};

/* Rows of a condition stand together, a row per method. */
#define ROWS N(methods)

struct row {
	const char *name, *motion;
	double tracker_hz, delay_ms, gap_ms;
	struct norms place_mm, velocity_mm_s, turn_deg;
	double theory_mm; /* rms of velocity · age and of noise: the error of a held pose */
};

static double distance(const double a[3], const double b[3])
{
	double between[3];

	v3_sub(between, a, b);
	return v3_length(between);
}

/* The angle between two attitudes; by a difference, as a cosine near 1 has no digits. */
static double angle_deg(const double p[4], const double q[4])
{
	double sign = p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3] < 0 ? -1 : 1;
	double sum = 0;

	for (int i = 0; i < 4; i++)
		sum += (p[i] - sign * q[i]) * (p[i] - sign * q[i]);
	return 4 * asin(fmin(sqrt(sum) / 2, 1)) * 180 / M_PI;
}

static void add_error(struct norms *norms, double error, int n)
{
	norms->rms = sqrt(norms->rms * norms->rms + error * error / n);
	norms->max = fmax(norms->max, error);
}

/* Of the ticks that count. */
static void measure_row(const struct track *track, const struct method *method,
			struct row *row)
{
	static const double rest[3];
	int ticks = track->condition.ticks, n = 0;
	struct state *own = cli_alloc(ticks, sizeof(*own)),
		     *shown = method->start ? own : track->late;
	double theory2 = 3 * NOISE_MM * NOISE_MM;

	if (method->start)
		show(track, method, shown);
	for (int k = 0; k < ticks; k++)
		n += track->counts[k];
	for (int k = 0; k < ticks; k++) {
		const struct state *is = &track->truth[k];
		double gone = distance(is->velocity_mm_s, rest) * track->age_s[k];

		if (!track->counts[k])
			continue;
		theory2 += gone * gone / n;
		add_error(&row->place_mm, distance(shown[k].position_mm, is->position_mm),
			  n);
		add_error(&row->velocity_mm_s,
			  distance(shown[k].velocity_mm_s, is->velocity_mm_s), n);
		add_error(&row->turn_deg, angle_deg(shown[k].quaternion, is->quaternion),
			  n);
	}
	row->theory_mm = sqrt(theory2);
	free(own);
}

/* --- the bench --- */

static struct row rows[N(motions) * N(delays_ms) * N(rates_hz) * ROWS];
static struct row losses[N(gaps_ms) * ROWS];
/* A row per method. */
static void measure(const struct condition *c, struct row *row)
{
	struct track track = track_begin(c);

	for (int i = 0; i < ROWS; i++, row++) {
		*row = (struct row){.name = methods[i].name,
				    .motion = c->motion->name,
				    .tracker_hz = c->tracker_hz,
				    .delay_ms = c->delay_ms,
				    .gap_ms = c->gap_ms};
		measure_row(&track, &methods[i], row);
	}
	track_end(&track);
}

static const struct bench_table rows_table = {
	.key = "rows",
	.row_bytes = sizeof(struct row),
	.columns = {COLUMN(row, "name", name), COLUMN(row, "motion", motion),
		    COLUMN(row, "tracker_hz", tracker_hz),
		    COLUMN(row, "delay_ms", delay_ms),
		    COLUMN(row, "rms_error_mm", place_mm.rms),
		    COLUMN(row, "max_error_mm", place_mm.max),
		    COLUMN(row, "rms_error_mm_s", velocity_mm_s.rms),
		    COLUMN(row, "max_error_mm_s", velocity_mm_s.max),
		    COLUMN(row, "rms_error_deg", turn_deg.rms),
		    COLUMN(row, "max_error_deg", turn_deg.max),
		    COLUMN(row, "held_theory_mm", theory_mm),
		    COLUMN(row, "gap_ms", gap_ms)},
	.metrics = {METRIC(EXACT, row, place_mm.rms, "mm", "{name}, {motion}, rms",
			   "tracker_hz=120,delay_ms=4")},
};

static void run(struct bench_run *run)
{
	static struct bench_table losses_table;
	int i = 0;
	struct condition c = {.gap_ms = NAN, .ticks = run->quick ? QUICK_TICKS : TICKS};

	for (int m = 0; m < N(motions); m++)
		for (int d = 0; d < N(delays_ms); d++)
			for (int r = 0; r < N(rates_hz); r++, i += ROWS) {
				c.motion = &motions[m];
				c.delay_ms = delays_ms[d];
				c.tracker_hz = rates_hz[r];
				cli_progress("%s, %g ms late, %g Hz", c.motion->name,
					     c.delay_ms, c.tracker_hz);
				measure(&c, &rows[i]);
			}
	c.motion = STROKE;
	c.delay_ms = USUAL_MS;
	c.tracker_hz = USUAL_HZ;
	for (int g = 0; g < N(gaps_ms); g++) {
		c.gap_ms = gaps_ms[g];
		measure(&c, &losses[g * ROWS]);
	}
	cli_progress_end();
	bench_values(run, "{sf sf sf sf}", "noise_mm", NOISE_MM, "jitter_ms", JITTER_MS,
		     "lost", LOST, "seconds", c.ticks * 1e-3);
	losses_table = rows_table;
	losses_table.key = "losses";
	memset(losses_table.metrics, 0, sizeof(losses_table.metrics));
	bench_rows(run, &rows_table, rows, N(rows));
	bench_rows(run, &losses_table, losses, N(losses));
}

const struct bench bench_program = {
	.name = "pose",
	.summary = "error of the predicted pose over tracker rate and delay",
	.run = run,
};
