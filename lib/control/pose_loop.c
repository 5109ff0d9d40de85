// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The loop of forces and a tracker; see pose_loop.h.
 *
 *   ticks      |     |     |     |     |     |     |     |
 *   arrivals  ·:·······················:·······················:     P apart, LEAD of a
 *   poses        '--- latency ---'                                   tick before one
 *              ├───────── P ───────────┤
 *              begin: a pose was just taken in
 */
#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <incise/clock.h>
#include "../base/vector.h"
#include "eigenvalues.h"
#include "pose_loop.h"

#define TICKS_MOST 64 /* in a P */
#define POSES_MOST 16 /* in a tick */
#define LATE_MOST 32  /* P in the latency */
/* Poses on their way are late by the latency, or wait for their tick. */
#define WAITING_MOST (LATE_MOST + POSES_MOST)
#define OWN_STATES 8 /* of device and predictor; the last one counts with A only */
/* For a mean over more ticks than one and these, each holds several. */
#define CELLS_MOST 31

/* Part of a tick, or of the shorter time between poses, that the last one waits before it is taken in: the mean. */
#define LEAD 0.5

/*
 * Size of a state that is tried, mm: so small that it stays within the predictor's
 * limits. All is linear below them.
 */
#define SIZE_MM 1e-6

/* Begins of all runs: late enough that no time is negative. */
#define BEGIN_NS (2 * INCISE_NS_PER_S)

struct loop {
	struct incise_plant plant[3]; /* at rest */
	struct incise_predict predict;
	double tick_s, pose_s, latency_s;
	int ticks, poses;	/* in a period */
	int waiting;		/* poses on their way when a period starts */
	int late;		/* ticks until a force acts … */
	double early_s;		/* … less this */
	int cells;		/* of the mean … */
	double cell_ticks;	/* … and so many ticks in each */
	int own_states, states; /* of an axis */
	bool hosted;		/* a period is a host's step … */
	bool cubic;		/* … with velocities */
	struct incise_force_map map;
};

struct pose_loop_run {
	struct incise_plant plant[3];
	struct incise_predict predict;
	double pose_mm[WAITING_MOST + POSES_MOST][3]; /* the oldest first */
	int n;
	double force_N[3];
	double late_N[INCISE_POSE_LOOP_LATE_MAX + 1]
		     [3];		   /* on their way, the oldest first */
	double cell_mm[CELLS_MOST + 1][3]; /* places before this tick, the oldest first */
	double t_s, change_s; /* … and when the next of them acts, before a tick */
};

static int64_t to_ns(double t_s)
{
	return BEGIN_NS + llround(t_s * INCISE_NS_PER_S);
}

/* Each state's place in a run, in mm, mm/s, mm/s², N. */
static double *find_loop_place(const struct loop *loop, struct pose_loop_run *run,
			       int state, int axis)
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
	if (state < loop->waiting)
		return &run->pose_mm[state][axis];
	state -= loop->waiting;
	return state < loop->late ? &run->late_N[state][axis]
				  : &run->cell_mm[state - loop->late][axis];
}

/* So that all are of one size: of speeds and accelerations in a period, and forces of a stiffness. */
static double unit(const struct loop *loop, int state)
{
	static const int order[OWN_STATES] = {0, 1, 0, 1, 2, 0, 1, 2};
	double period_s = loop->ticks * loop->tick_s, most_N_mm = 0;
	int late = state - loop->own_states - loop->waiting;

	if (state < loop->own_states)
		return pow(period_s, -order[state]);
	if (loop->cubic && late == -1)
		return 1 / period_s;
	for (int i = 0; i < 3; i++)
		most_N_mm = fmax(most_N_mm, fabs(loop->map.now[i][i]));
	return late >= 0 && late < loop->late && most_N_mm > 0 ? most_N_mm : 1;
}

static void go_straight(struct pose_loop_run *run, double t_s)
{
	for (int i = 0; i < 3; i++)
		incise_plant_step(&run->plant[i], run->force_N[i],
				  fmax(t_s - run->t_s, 0));
	run->t_s = t_s;
}

static void go_to(struct pose_loop_run *run, double t_s)
{
	if (run->change_s > run->t_s && run->change_s <= t_s) {
		go_straight(run, run->change_s);
		v3_copy(run->force_N, run->late_N[0]);
	}
	go_straight(run, t_s);
}

static void take_place(struct pose_loop_run *run, const double at_mm[3], double arrival_s)
{
	struct incise_tracker_sample sample = {
		.t_ns = to_ns(arrival_s),
		.quaternion = {1},
	};

	v3_copy(sample.position_mm, at_mm);
	incise_predict_add(&run->predict, &sample);
}

static void take_pose_loop(struct pose_loop_run *run, double arrival_s)
{
	take_place(run, run->pose_mm[0], arrival_s);
	memmove(run->pose_mm[0], run->pose_mm[1],
		(size_t)--run->n * sizeof(run->pose_mm[0]));
}

/* The mean of the last places, with this one. A cell of several ticks follows the next in parts. */
static void set_mean(const struct loop *loop, struct pose_loop_run *run,
		     const double x[3], double mean[3])
{
	double left = loop->map.mean_ticks - 1, c = loop->cell_ticks;

	v3_copy(mean, x);
	v3_copy(run->cell_mm[loop->cells], x);
	for (int k = loop->cells - 1; k >= 0; k--, left -= c)
		v3_add(mean, mean, fmin(left, c), run->cell_mm[k]);
	for (int i = 0; i < 3; i++) {
		mean[i] /= loop->map.mean_ticks;
		for (int k = 0; k < loop->cells; k++)
			run->cell_mm[k][i] +=
				(run->cell_mm[k + 1][i] - run->cell_mm[k][i]) / c;
	}
}

static void find_force(const struct loop *loop, struct pose_loop_run *run, double t_s,
		       double force_N[3])
{
	const struct incise_force_map *map = &loop->map;
	double x[3], v[3], a[3] = {0}, mean[3] = {0}, attitude[4];

	incise_predict_at(&run->predict, to_ns(t_s), x, v, attitude);
	if (loop->own_states == OWN_STATES)
		incise_predict_acceleration(&run->predict, to_ns(t_s), a);
	if (map->mean_ticks > 1)
		set_mean(loop, run, x, mean);
	for (int i = 0; i < 3; i++)
		force_N[i] = -v3_dot(map->now[i], x) - v3_dot(map->mean[i], mean) -
			     v3_dot(map->damping[i], v) - v3_dot(map->mass[i], a);
}

static void set_force(const struct loop *loop, struct pose_loop_run *run,
		      const double force_N[3])
{
	v3_copy(run->late_N[loop->late], force_N);
	memcpy(run->force_N, run->late_N[0], sizeof(run->force_N));
	memmove(run->late_N[0], run->late_N[1],
		(size_t)loop->late * sizeof(run->late_N[0]));
	run->change_s = run->t_s + (loop->early_s > 0 ? loop->tick_s - loop->early_s : 0);
}

/* A step of a host. */
static void run_step(const struct loop *loop, struct pose_loop_run *run)
{
	double step_s = loop->ticks * loop->tick_s, force_N[3], at_mm[3];
	struct incise_host_place from, to;

	v3_copy(from.at_mm, run->pose_mm[0]);
	v3_copy(from.mm_s, run->pose_mm[1]);
	for (int i = 0; i < 3; i++) {
		to.at_mm[i] = run->plant[i].position_mm;
		to.mm_s[i] = run->plant[i].velocity_mm_s;
	}
	for (int k = 1; k <= loop->ticks; k++) {
		double t_s = k * loop->tick_s - step_s;

		incise_host_between(at_mm, &from, &to, step_s, (double)k / loop->ticks,
				    loop->cubic);
		take_place(run, at_mm, t_s);
		find_force(loop, run, t_s, force_N);
	}
	v3_copy(run->pose_mm[0], to.at_mm);
	v3_copy(run->pose_mm[1], to.mm_s);
	for (int k = 1; k <= loop->ticks; k++) {
		set_force(loop, run, force_N);
		go_to(run, k * loop->tick_s);
	}
}

/* The time for which a pose waits. */
static double lead(const struct loop *loop)
{
	return LEAD * fmin(loop->tick_s, loop->pose_s);
}

/* Round a period: the last poses are taken in before the tick that starts the next one. */
static void run_period(const struct loop *loop, struct pose_loop_run *run)
{
	double lead_s = lead(loop), force_N[3];
	int taken = 0;

	for (int k = 1; k <= loop->ticks; k++) {
		find_force(loop, run, run->t_s, force_N);
		set_force(loop, run, force_N);
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
		take_pose_loop(run, i * loop->pose_s - lead_s);
}

static int size_of_pose_loop(const struct loop *loop)
{
	return 3 * loop->states;
}

/* The effect of a period on each state, column by column. */
static void measure_period(const struct loop *loop, double *matrix)
{
	int n = size_of_pose_loop(loop);

	for (int column = 0; column < n; column++) {
		struct pose_loop_run run = {
			.plant = {loop->plant[0], loop->plant[1], loop->plant[2]},
			.predict = loop->predict,
			.n = loop->waiting,
		};

		*find_loop_place(loop, &run, column / 3, column % 3) =
			SIZE_MM * unit(loop, column / 3);
		(loop->hosted ? run_step : run_period)(loop, &run);
		for (int row = 0; row < n; row++)
			matrix[row * n + column] =
				*find_loop_place(loop, &run, row / 3, row % 3) /
				(SIZE_MM * unit(loop, row / 3));
	}
}

/* In a period; less is no growth: a predictor with a gain of 0 has a state that stays. */
#define GROWS 1e-7

/* The eigenvalue of the matrix's fastest growing swing, and 0 without a swing. */
static double complex fastest(double *matrix, int n)
{
	double complex *all = malloc((size_t)n * sizeof(*all)), most = 0;

	if (!all || !incise_eigenvalues(matrix, n, all)) {
		free(all);
		return DBL_MAX;
	}
	for (int i = 0; i < n; i++)
		/* A motion that grows by e before it turns by a radian only goes away. */
		if (cabs(all[i]) > cabs(most) && cimag(all[i]) >= 0 &&
		    carg(all[i]) > log(cabs(all[i])))
			most = all[i];
	free(all);
	return most;
}

/* Times that are multiples of each other, each at least as long as it is. */
static void set_times(struct loop *loop, double tick_s)
{
	double pose_s = loop->predict.period_s;

	loop->latency_s = (double)loop->predict.latency_ns / INCISE_NS_PER_S;
	pose_s = fmax(pose_s, fmax(loop->latency_s / LATE_MOST, tick_s / POSES_MOST));
	loop->ticks = (int)fmin(fmax(pose_s / tick_s + 1e-9, 1), TICKS_MOST);
	loop->poses = (int)fmax(tick_s / pose_s + 1e-9, 1);
	loop->pose_s = fmax(pose_s, tick_s / loop->poses);
	loop->tick_s = loop->pose_s * loop->poses / loop->ticks;
	loop->waiting = (int)((loop->latency_s + lead(loop)) / loop->pose_s + 1e-9);
}

/* A pose for each tick; a host's last one waits, with its velocity. */
static void set_step(struct loop *loop, double tick_s, int ticks)
{
	loop->tick_s = loop->pose_s = tick_s;
	loop->ticks = ticks;
	loop->waiting = loop->cubic ? 2 : 1;
}

/* The predictor as it is at the begin of a period, with all that it knows 0. */
static void set_predict(struct loop *loop)
{
	struct incise_predict *p = &loop->predict;

	p->gap_ns = llround((double)p->gap_ns * loop->pose_s / p->period_s);
	p->period_s = loop->pose_s;
	incise_double_predict_init(&p->now);
	p->now.started = true;
	p->now.arrival_ns =
		to_ns(-(loop->hosted ? loop->tick_s * loop->ticks : lead(loop)));
	p->now.t_ns = p->now.arrival_ns - p->latency_ns;
}

static void loop_init(struct loop *loop, const struct incise_pose_loop *of,
		      const struct incise_force_map *map)
{
	bool mass = false;

	*loop = (struct loop){
		.predict = *of->predict,
		.late = of->late_ticks,
		.early_s = of->early_s,
		.map = *map,
		.hosted = of->hold.ticks > 1,
		.cubic = of->hold.ticks > 1 && of->hold.cubic,
	};
	if (map->mean_ticks > 1) {
		loop->cells = (int)fmin(map->mean_ticks - 1, CELLS_MOST);
		loop->cell_ticks = (map->mean_ticks - 1.0) / loop->cells;
	}
	for (int i = 0; i < 9; i++)
		mass = mass || map->mass[i / 3][i % 3] != 0;
	loop->own_states = mass ? OWN_STATES : OWN_STATES - 1;
	if (loop->hosted)
		set_step(loop, of->period_s, of->hold.ticks);
	else
		set_times(loop, of->period_s);
	loop->states = loop->own_states + loop->waiting + loop->late + loop->cells;
	set_predict(loop);
}

struct incise_plant incise_pose_loop_plant(double mass_kg, double damping_N_s_mm,
					   const struct incise_hand_impedance *hand)
{
	struct incise_plant plant = {.mass_kg = mass_kg,
				     .damping_N_s_mm = damping_N_s_mm};

	if (!hand)
		return plant;
	plant.mass_kg += hand->mass_kg;
	plant.damping_N_s_mm += hand->damping_N_s_mm;
	plant.wall_N_mm = hand->stiffness_N_mm;
	plant.tied = true;
	return plant;
}

/* Direction of the fastest swing: of its places, or of their speeds. */
static void set_along(const struct loop *loop, const double *matrix,
		      double complex eigenvalue, double *work, double along[3])
{
	double *x = malloc((size_t)size_of_pose_loop(loop) * sizeof(*x));

	v3_copy(along, (double[3]){0});
	if (!x)
		return;
	for (int i = 0; i < size_of_pose_loop(loop); i++)
		x[i] = 1 + i % 7;
	incise_eigenvector(matrix, size_of_pose_loop(loop), eigenvalue, work, x);
	v3_copy(along, v3_length(x) * carg(eigenvalue) > v3_length(x + 3) ? x : x + 3);
	v3_unit(along, along, 0);
	free(x);
}

double incise_pose_loop_swing(const struct incise_pose_loop *of,
			      const struct incise_plant axis[3],
			      const struct incise_force_map *map, double share,
			      struct incise_swing *swing)
{
	double *matrix, *work, period_s;
	struct incise_force_map scaled = *map;
	double complex eigenvalue;
	struct loop loop;
	int n;

	for (int i = 0; i < 9; i++) {
		scaled.now[i / 3][i % 3] *= share;
		scaled.mean[i / 3][i % 3] *= share;
		scaled.damping[i / 3][i % 3] *= share;
		scaled.mass[i / 3][i % 3] *= share;
	}
	loop_init(&loop, of, &scaled);
	for (int i = 0; i < 3; i++) {
		loop.plant[i] = axis[i];
		loop.plant[i].position_mm = loop.plant[i].velocity_mm_s =
			loop.plant[i].wall_mm = 0;
	}
	n = size_of_pose_loop(&loop);
	matrix = calloc(2 * (size_t)n * (size_t)n, sizeof(*matrix));
	if (!matrix)
		return INFINITY;
	work = matrix + (size_t)n * (size_t)n;
	measure_period(&loop, matrix);
	memcpy(work, matrix, (size_t)n * (size_t)n * sizeof(*work));
	eigenvalue = fastest(work, n);
	period_s = loop.ticks * loop.tick_s;
	if (swing) {
		swing->hz = carg(eigenvalue) / (2 * M_PI * period_s);
		set_along(&loop, matrix, eigenvalue, work, swing->along);
	}
	free(matrix);
	return cabs(eigenvalue) > 1 + GROWS ? log(cabs(eigenvalue)) / period_s : 0;
}

#define MARGIN_LEAST (1.0 / 1024) /* of the most; less counts as no margin */
#define MARGIN_HALVINGS 11	  /* of its logarithm: within 3 thousandths */

double incise_pose_loop_margin(const struct incise_pose_loop *of,
			       const struct incise_plant axis[3],
			       const struct incise_force_map *map, double most,
			       struct incise_swing *swing)
{
	double low = most * MARGIN_LEAST, high = most;

	if (!(incise_pose_loop_swing(of, axis, map, most, NULL) > 0))
		return most;
	for (int i = 0; i < MARGIN_HALVINGS; i++) {
		double middle = sqrt(low * high);

		if (incise_pose_loop_swing(of, axis, map, middle, NULL) > 0)
			high = middle;
		else
			low = middle;
	}
	incise_pose_loop_swing(of, axis, map, high, swing);
	return low;
}
