// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The loop of a wall and a tracker; see pose_loop.h.
 *
 *   ticks      |     |     |     |     |     |     |     |
 *   arrivals  ·:·······················:·······················:     P apart, LEAD of a
 *   poses        '--- latency ---'                                   tick before one
 *              ├───────── P ───────────┤
 *              begin: a pose was just taken in
 */
#include <math.h>
#include <stdbool.h>
#include <string.h>
#include <incise/clock.h>
#include "plant.h"
#include "../base/units.h"
#include "pose_loop.h"

#define TICKS_MOST 64 /* in a P */
#define POSES_MOST 16 /* in a tick */
#define LATE_MOST 32  /* P in the latency */
/* On their way are those of the latency, and those that wait for their tick. */
#define WAITING_MOST (LATE_MOST + POSES_MOST)
#define OWN_STATES 8 /* of device and predictor; the last one counts with A only */
#define STATES (OWN_STATES + WAITING_MOST + INCISE_POSE_LOOP_LATE_MAX)

/* Part of a tick that a pose waits before it is taken in: the mean. */
#define LEAD 0.5

/*
 * Size of a state that is tried, mm: so small that the predictor's limits of what it
 * believes are not met. All is linear below them.
 */
#define SIZE_MM 1e-6

/* Begins of all runs: late enough that no time is negative. */
#define BEGIN_NS (2 * INCISE_NS_PER_S)

struct loop {
	struct incise_plant plant; /* at rest */
	struct incise_predict predict;
	double tick_s, pose_s, latency_s;
	int ticks, poses; /* in a period */
	int waiting;	  /* poses on their way when a period starts */
	int late;	  /* ticks until a force acts */
	int own_states, states;
	double K, B, A;
};

/* Three runs at once: the predictor has three axes. */
struct run {
	struct incise_plant plant[3];
	struct incise_predict predict;
	double pose_mm[WAITING_MOST + POSES_MOST][3]; /* the oldest first */
	int n;
	double force_N[3];
	double late_N[INCISE_POSE_LOOP_LATE_MAX + 1]
		     [3]; /* on their way, the oldest first */
	double t_s;
};

static int64_t to_ns(double t_s)
{
	return BEGIN_NS + llround(t_s * INCISE_NS_PER_S);
}

/* Each state's place in a run, in mm, mm/s, mm/s², N. */
static double *place(const struct loop *loop, struct run *run, int state, int axis)
{
	double *const own[OWN_STATES] = {
		&run->plant[axis].position_mm,	 &run->plant[axis].velocity_mm_s,
		&run->predict.now.x[axis],	 &run->predict.now.v[axis],
		&run->predict.now.a[axis],	 &run->predict.now.x_shown[axis],
		&run->predict.now.v_shown[axis], &run->predict.now.a_shown[axis],
	};

	if (state < loop->own_states)
		return own[state];
	state -= loop->own_states;
	return state < loop->waiting ? &run->pose_mm[state][axis]
				     : &run->late_N[state - loop->waiting][axis];
}

static void go_to(struct run *run, double t_s)
{
	for (int i = 0; i < 3; i++)
		incise_plant_step(&run->plant[i], run->force_N[i],
				  fmax(t_s - run->t_s, 0));
	run->t_s = t_s;
}

static void take_pose(struct run *run, double arrival_s)
{
	struct incise_tracker_sample sample = {
		.t_ns = to_ns(arrival_s),
		.quaternion = {1},
	};

	memcpy(sample.position_mm, run->pose_mm[0], sizeof(run->pose_mm[0]));
	incise_predict_add(&run->predict, &sample);
	memmove(run->pose_mm[0], run->pose_mm[1],
		(size_t)--run->n * sizeof(run->pose_mm[0]));
}

static void set_force(const struct loop *loop, struct run *run)
{
	double x[3], v[3], a[3] = {0}, attitude[4];

	incise_predict_at(&run->predict, to_ns(run->t_s), x, v, attitude);
	if (loop->A != 0)
		incise_predict_acceleration(&run->predict, to_ns(run->t_s), a);
	for (int i = 0; i < 3; i++)
		run->late_N[loop->late][i] =
			-loop->K * x[i] - loop->B * v[i] - loop->A * a[i];
	memcpy(run->force_N, run->late_N[0], sizeof(run->force_N));
	memmove(run->late_N[0], run->late_N[1],
		(size_t)loop->late * sizeof(run->late_N[0]));
}

/* Round a period: the last poses are taken in before the tick that starts the next one. */
static void run_period(const struct loop *loop, struct run *run)
{
	double lead_s = LEAD * loop->tick_s;
	int taken = 0;

	for (int k = 1; k <= loop->ticks; k++) {
		set_force(loop, run);
		for (; taken < loop->poses; taken++) {
			double t_s = (loop->waiting + 1 + taken) * loop->pose_s -
				     loop->latency_s - lead_s;

			if (t_s > k * loop->tick_s && k < loop->ticks)
				break;
			go_to(run, t_s);
			for (int i = 0; i < 3; i++)
				run->pose_mm[run->n][i] = run->plant[i].position_mm;
			run->n++;
		}
		go_to(run, k * loop->tick_s);
	}
	for (int i = 1; i <= loop->poses; i++)
		take_pose(run, i * loop->pose_s - lead_s);
}

/* The effect of a period on each state, column by column. */
static void measure(const struct loop *loop, double matrix[STATES][STATES])
{
	for (int column = 0; column < loop->states; column += 3) {
		struct run run = {
			.plant = {loop->plant, loop->plant, loop->plant},
			.predict = loop->predict,
			.n = loop->waiting,
		};

		for (int i = 0; i < 3 && column + i < loop->states; i++)
			*place(loop, &run, column + i, i) = SIZE_MM;
		run_period(loop, &run);
		for (int row = 0; row < loop->states; row++)
			for (int i = 0; i < 3 && column + i < loop->states; i++)
				matrix[row][column + i] =
					*place(loop, &run, row, i) / SIZE_MM;
	}
}

/* The largest sum of a row, by which the matrix is divided; 0 when that is no number. */
static double normalise(double matrix[STATES][STATES], int n)
{
	double most = 0;

	for (int i = 0; i < n; i++) {
		double sum = 0;

		for (int j = 0; j < n; j++)
			sum += fabs(matrix[i][j]);
		if (!isfinite(sum))
			return 0;
		most = fmax(most, sum);
	}
	for (int i = 0; i < n && most > 0; i++)
		for (int j = 0; j < n; j++)
			matrix[i][j] /= most;
	return most;
}

/*
 * Whether no eigenvalue is above 1, by squaring: of the norms |M^n| the n-th root tends to
 * the largest, and one of them below 1 proves it. After 30 squarings e^100 is a growth of
 * 1e-7 per period, which is none: a predictor with a gain of 0 has a state that stays.
 */
#define SQUARINGS 30
#define STAYS 100

static bool decays(double matrix[STATES][STATES], int n)
{
	double log_norm = 0;

	for (int n_squared = 0; n_squared < SQUARINGS; n_squared++) {
		double square[STATES][STATES], norm = normalise(matrix, n);

		if (!(norm > 0))
			return false;
		log_norm = 2 * log_norm + log(norm);
		if (log_norm < 0)
			return true;
		/* Only the states that there are: most of the array is not used. */
		for (int i = 0; i < n; i++) {
			memset(square[i], 0, (size_t)n * sizeof(**square));
			for (int k = 0; k < n; k++)
				for (int j = 0; j < n; j++)
					square[i][j] += matrix[i][k] * matrix[k][j];
		}
		for (int i = 0; i < n; i++)
			memcpy(matrix[i], square[i], (size_t)n * sizeof(**square));
	}
	return log_norm < STAYS;
}

static bool stable(struct loop *loop, double stiffness_N_mm)
{
	double matrix[STATES][STATES];

	loop->K = stiffness_N_mm;
	measure(loop, matrix);
	return decays(matrix, loop->states);
}

/* Times that are multiples of each other, none shorter than it is. */
static void set_times(struct loop *loop, double tick_s)
{
	double pose_s = loop->predict.period_s;

	loop->latency_s = (double)loop->predict.latency_ns / INCISE_NS_PER_S;
	pose_s = fmax(pose_s, fmax(loop->latency_s / LATE_MOST, tick_s / POSES_MOST));
	loop->ticks = (int)fmin(fmax(pose_s / tick_s + 1e-9, 1), TICKS_MOST);
	loop->poses = (int)fmax(tick_s / pose_s + 1e-9, 1);
	loop->pose_s = fmax(pose_s, tick_s / loop->poses);
	loop->tick_s = loop->pose_s * loop->poses / loop->ticks;
	loop->waiting =
		(int)((loop->latency_s + LEAD * loop->tick_s) / loop->pose_s + 1e-9);
	loop->own_states = loop->A != 0 ? OWN_STATES : OWN_STATES - 1;
	loop->states = loop->own_states + loop->waiting + loop->late;
}

/* The predictor as it is at the begin of a period, with all that it knows 0. */
static void set_predict(struct loop *loop)
{
	struct incise_predict *p = &loop->predict;

	p->gap_ns = llround((double)p->gap_ns * loop->pose_s / p->period_s);
	p->period_s = loop->pose_s;
	incise_double_predict_init(&p->now);
	p->now.started = true;
	p->now.arrival_ns = to_ns(-LEAD * loop->tick_s);
	p->now.t_ns = p->now.arrival_ns - p->latency_ns;
}

static bool valid(const struct incise_pose_loop *of)
{
	const struct incise_haptic_device *d = of->device;

	return d->mass_kg > 0 && isfinite(d->mass_kg) && d->damping_N_s_mm >= 0 &&
	       isfinite(d->damping_N_s_mm) && d->period_s > 0 && isfinite(d->period_s) &&
	       isfinite(of->damping_N_s_mm) && isfinite(of->acceleration_N_s2_mm) &&
	       of->late_ticks >= 0 && of->late_ticks <= INCISE_POSE_LOOP_LATE_MAX;
}

static void loop_init(struct loop *loop, const struct incise_pose_loop *of)
{
	const struct incise_haptic_device *device = of->device;
	const struct incise_hand_impedance *hand = of->hand;

	*loop = (struct loop){
		.plant = {.mass_kg = device->mass_kg,
			  .damping_N_s_mm = device->damping_N_s_mm},
		.predict = *of->predict,
		.late = of->late_ticks,
		.B = of->damping_N_s_mm,
		.A = of->acceleration_N_s2_mm,
	};
	if (hand) {
		loop->plant.mass_kg += hand->mass_kg;
		loop->plant.damping_N_s_mm += hand->damping_N_s_mm;
		loop->plant.wall_N_mm = hand->stiffness_N_mm;
		loop->plant.tied = true;
	}
	set_times(loop, device->period_s);
	set_predict(loop);
}

bool incise_pose_loop_holds(const struct incise_pose_loop *of, double stiffness_N_mm)
{
	struct loop loop;

	if (!valid(of) || !isfinite(stiffness_N_mm))
		return false;
	loop_init(&loop, of);
	return stable(&loop, stiffness_N_mm);
}

/* The scan: softest wall, as a part of what a delay holds; factor; how many. */
#define SOFTEST 1e-4
#define FACTOR 1.05
#define STEPS 400
#define HALVINGS 40

double incise_pose_loop_limit(const struct incise_pose_loop *of)
{
	double late_s, low = 0, high;
	struct loop loop;

	if (!valid(of))
		return 0;
	loop_init(&loop, of);
	late_s = loop.latency_s + loop.pose_s + loop.late * loop.tick_s;
	high = loop.plant.mass_kg * N_S2_PER_MM_KG / late_s;
	if (loop.plant.damping_N_s_mm > 0)
		high = fmin(high, loop.plant.damping_N_s_mm);
	high *= SOFTEST / late_s;
	/* Upwards, for a wall may be stable again beyond one that is not. */
	for (int i = 0; i < STEPS && stable(&loop, high); i++) {
		low = high;
		high *= FACTOR;
	}
	for (int i = 0; i < HALVINGS && low > 0; i++) {
		double middle = (low + high) / 2;

		*(stable(&loop, middle) ? &low : &high) = middle;
	}
	return low;
}
