// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/home.c: on a machine whose switches are scripted, the count ends as the
 * machine's position, wherever it began, or it is said why not and nothing moves.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <incise/backend.h>

#define TRAVEL_MM 20.0
#define STEP_MM 0.001
#define SPEED_MM_S 5.0
#define ACCELERATION_MM_S2 500.0

/* A nut that keeps speed and acceleration, in steps of 0.1 ms; mm of the machine. */
struct machine {
	struct incise_stepper stepper;
	unsigned int home_at;	/* the input that is wired */
	double edge_mm, end_mm; /* active from end to edge */
	double home_mm;
	bool stuck_on, stuck_off, estop, deaf;
	int polls, stop_at;
	int stop;
	const char *cause; /* what it tells of its fault; or NULL */

	double at_mm, v_mm_s, target_mm, count_mm; /* count: position less at_mm */
	bool by_speed, homed, touched;
	double edge_count_mm;
	unsigned int faults;
	enum incise_stepper_state state;
	int64_t t_ns, set_ns;
};

static struct machine *of(const struct incise_stepper *stepper)
{
	return (struct machine *)stepper;
}

static double position(const struct machine *m)
{
	return round((m->at_mm + m->count_mm) / STEP_MM) * STEP_MM;
}

static bool touches(const struct machine *m)
{
	return m->stuck_on ||
	       (!m->stuck_off && m->at_mm <= m->edge_mm && m->at_mm >= m->end_mm);
}

static bool powered(const struct machine *m)
{
	return m->state == INCISE_STEPPER_READY || m->state == INCISE_STEPPER_MOVING;
}

static void halt(struct machine *m, unsigned int fault)
{
	m->faults |= fault;
	m->v_mm_s = 0;
	m->homed = false;
	m->state = INCISE_STEPPER_FAULT;
}

static void move(struct machine *m, double dt)
{
	double wanted = m->by_speed ? m->target_mm : 0, most = ACCELERATION_MM_S2 * dt;
	double at = position(m), off = m->target_mm - at;

	if (m->deaf)
		wanted = 0;
	else if (!m->by_speed && fabs(off) > STEP_MM / 2)
		wanted = copysign(fmin(10, sqrt(ACCELERATION_MM_S2 * fabs(off))), off);
	/* As a backend does, it comes to rest at the ends of its count. */
	if (m->by_speed && wanted < 0)
		wanted = fmax(wanted, -sqrt(ACCELERATION_MM_S2 * fmax(0, at)));
	if (m->by_speed && wanted > 0)
		wanted = fmin(wanted, sqrt(ACCELERATION_MM_S2 * fmax(0, TRAVEL_MM - at)));
	m->v_mm_s = fmax(m->v_mm_s - most, fmin(m->v_mm_s + most, wanted));
	if (fabs(m->v_mm_s) < STEP_MM && fabs(wanted) < STEP_MM)
		m->v_mm_s = 0;
	if (m->home_at == INCISE_STEPPER_AT_MIN && touches(m) && m->v_mm_s < 0) {
		halt(m, INCISE_STEPPER_LIMIT_MIN);
		return;
	}
	m->at_mm += m->v_mm_s * dt;
	m->state = m->v_mm_s ? INCISE_STEPPER_MOVING : INCISE_STEPPER_READY;
}

static int machine_wait(struct incise_stepper *stepper, int64_t ns)
{
	struct machine *m = of(stepper);

	for (int64_t end = m->t_ns + ns; m->t_ns < end; m->t_ns += 100000) {
		bool before = m->touched;

		if (powered(m) && m->t_ns - m->set_ns > 50000000)
			halt(m, INCISE_STEPPER_DEADMAN);
		if (powered(m) && m->estop && m->polls > 100)
			halt(m, INCISE_STEPPER_ESTOP);
		if (powered(m))
			move(m, 1e-4);
		m->touched = touches(m);
		if (m->touched && !before)
			m->edge_count_mm = position(m);
	}
	if (++m->polls == m->stop_at)
		m->stop = 1;
	return 0;
}

static int machine_take(struct machine *m, double target, bool by_speed)
{
	if (!powered(m))
		return -EIO;
	m->target_mm = target;
	m->by_speed = by_speed;
	m->set_ns = m->t_ns;
	return 0;
}

static int machine_set(struct incise_stepper *stepper, double position_mm)
{
	double steps = round(fmax(0, fmin(TRAVEL_MM, position_mm)) / STEP_MM);

	return machine_take(of(stepper), steps * STEP_MM, false);
}

static int machine_jog(struct incise_stepper *stepper, double velocity_mm_s)
{
	return machine_take(of(stepper), velocity_mm_s, true);
}

static int machine_status(struct incise_stepper *stepper,
			  struct incise_stepper_status *status)
{
	struct machine *m = of(stepper);

	*status = (struct incise_stepper_status){
		.position_mm = position(m),
		.velocity_mm_s = m->v_mm_s,
		.faults = m->faults,
		.state = m->state,
		.inputs = touches(m) ? m->home_at : 0,
		.homed = m->homed,
	};
	return 0;
}

static int machine_enable(struct incise_stepper *stepper, struct incise_error *err)
{
	struct machine *m = of(stepper);

	if (m->faults)
		return incise_error_set(err, EPERM, "clear it");
	m->state = INCISE_STEPPER_READY;
	return machine_take(m, position(m), false);
}

static int machine_clear(struct incise_stepper *stepper, struct incise_error *err)
{
	of(stepper)->faults = 0;
	of(stepper)->state = INCISE_STEPPER_DISABLED;
	return 0;
}

static void machine_info(const struct incise_stepper *stepper,
			 struct incise_stepper_info *info)
{
	*info = (struct incise_stepper_info){
		.name = "machine",
		.travel_mm = TRAVEL_MM,
		.step_mm = STEP_MM,
		.deadman_s = 0.05,
	};
}

static int machine_cause(struct incise_stepper *stepper, char *text, size_t size)
{
	const char *cause = of(stepper)->cause;

	return cause ? snprintf(text, size, "%s", cause) : 0;
}

static int machine_homing(struct incise_stepper *stepper,
			  struct incise_stepper_homing *homing)
{
	struct machine *m = of(stepper);

	*homing = (struct incise_stepper_homing){SPEED_MM_S, m->home_mm, m->home_at};
	return m->home_at ? 0 : -EOPNOTSUPP;
}

static int machine_edge(struct incise_stepper *stepper, struct incise_stepper_edge *edge)
{
	struct machine *m = of(stepper);

	*edge = (struct incise_stepper_edge){0};
	if (m->home_at == INCISE_STEPPER_AT_HOME)
		*edge = (struct incise_stepper_edge){m->touched, m->edge_count_mm};
	return 0;
}

static int machine_origin(struct incise_stepper *stepper, double position_mm, bool homed)
{
	struct machine *m = of(stepper);

	if (m->v_mm_s)
		return -EBUSY;
	if (position_mm < 0 || position_mm > TRAVEL_MM)
		return -EINVAL;
	m->count_mm = position_mm - m->at_mm;
	m->homed = homed;
	return machine_take(m, position_mm, false);
}

static const struct incise_stepper_ops ops = {
	.set = machine_set,
	.jog = machine_jog,
	.status = machine_status,
	.enable = machine_enable,
	.clear = machine_clear,
	.info = machine_info,
	.cause = machine_cause,
	.homing = machine_homing,
	.edge = machine_edge,
	.origin = machine_origin,
	.wait = machine_wait,
};

static void powered_at(struct machine *m, double at_mm)
{
	m->stepper.ops = &ops;
	m->at_mm = at_mm;
	m->touched = touches(m);
	assert_int_equal(incise_stepper_enable(&m->stepper, NULL), 0);
}

static void the_count_becomes_the_position(void **state)
{
	static const double starts_mm[] = {0.01, 3, 11.7, 19.9, -1, 22};
	static const struct {
		unsigned int home_at;
		double edge_mm, end_mm, home_mm;
	} cases[] = {
		{INCISE_STEPPER_AT_HOME, 0, -9, 0},
		{INCISE_STEPPER_AT_HOME, 0, -9, 1.5},
		{INCISE_STEPPER_AT_HOME, 0, -9, -0.25},
		/* A mark that is gone between two polls at full speed. */
		{INCISE_STEPPER_AT_HOME, 0, -0.003, 0},
		{INCISE_STEPPER_AT_MIN, 0, -9, 0},
		{INCISE_STEPPER_AT_MIN, 0, -9, -0.5},
		{INCISE_STEPPER_AT_MIN, 0, -9, 0.75},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++)
		for (size_t k = 0; k < sizeof(starts_mm) / sizeof(*starts_mm); k++) {
			struct machine m = {
				.home_at = cases[i].home_at,
				.edge_mm = cases[i].edge_mm,
				.end_mm = cases[i].end_mm,
				.home_mm = cases[i].home_mm,
			};
			struct incise_error err = {0};
			double rest_mm = fmax(0, m.home_mm), off;
			int rc;

			/* Below a mark there is nothing to be found. */
			if (m.end_mm > starts_mm[k])
				continue;
			powered_at(&m, starts_mm[k]);
			rc = incise_stepper_home(&m.stepper, &m.stop, &err);
			if (rc)
				fail_msg("case %zu from %g mm: %s", i, starts_mm[k],
					 err.text);
			assert_true(m.homed && m.state == INCISE_STEPPER_READY);
			assert_true(fabs(position(&m) - rest_mm) < STEP_MM / 2);
			/*
			 * The edge is read to what a tenth of the speed goes in one poll
			 * of 1 ms, 0.5 µm, to a tick's way and to half a step.
			 */
			off = position(&m) - m.home_mm - (m.at_mm - m.edge_mm);
			if (!(fabs(off) < 0.0005 + 0.00005 + STEP_MM))
				fail_msg("case %zu from %g mm: off by %g mm", i,
					 starts_mm[k], off);
		}
}

/* The count at the edge, read before homing names places anew; as well as homing reads. */
static void the_edge_is_told_in_the_old_count(void **state)
{
	static const unsigned int inputs[] = {INCISE_STEPPER_AT_HOME,
					      INCISE_STEPPER_AT_MIN};
	static const double lost_mm[] = {0, 0.25, -0.125, 3};

	for (size_t i = 0; i < 2; i++) {
		struct machine m = {
			.home_at = inputs[i], .edge_mm = 0.5, .end_mm = -9, .home_mm = 2};

		powered_at(&m, 7);
		for (size_t k = 0; k < sizeof(lost_mm) / sizeof(*lost_mm); k++) {
			struct incise_stepper_edge_found edge = {0};
			double was_mm;

			m.count_mm += lost_mm[k];
			was_mm = m.edge_mm + m.count_mm;
			assert_int_equal(incise_stepper_home_edge(&m.stepper, &m.stop,
								  &edge, NULL),
					 0);
			assert_true(edge.after_mm == 2);
			if (!(fabs(edge.before_mm - was_mm) < 0.0005 + 0.00005 + STEP_MM))
				fail_msg("input %u, %g mm lost: %g, was %g", inputs[i],
					 lost_mm[k], edge.before_mm, was_mm);
		}
	}
}

static void what_is_wrong_is_said(void **state)
{
	static const struct {
		struct machine m;
		int rc;
		const char *says;
	} cases[] = {
		{{.home_at = 0}, -EOPNOTSUPP, "neither a home input nor"},
		{{.home_at = INCISE_STEPPER_AT_HOME, .stuck_off = true},
		 -EIO,
		 "did not come within the travel"},
		{{.home_at = INCISE_STEPPER_AT_HOME, .stuck_on = true},
		 -EIO,
		 "stays active"},
		{{.home_at = INCISE_STEPPER_AT_HOME, .end_mm = -9, .estop = true},
		 -EIO,
		 "e-stop: release it"},
		{{.home_at = INCISE_STEPPER_AT_HOME,
		  .end_mm = -9,
		  .estop = true,
		  .cause = "safe torque off (5441h)"},
		 -EIO,
		 "homing machine: safe torque off (5441h)"},
		{{.home_at = INCISE_STEPPER_AT_HOME, .end_mm = -9, .deaf = true},
		 -ETIMEDOUT,
		 "not done in time"},
		{{.home_at = INCISE_STEPPER_AT_HOME, .end_mm = -9, .stop_at = 50},
		 -EINTR,
		 "stopped"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct machine m = cases[i].m;
		struct incise_error err = {0};
		struct incise_stepper_edge_found edge = {77, 78};
		int rc;

		powered_at(&m, 10);
		rc = incise_stepper_home_edge(&m.stepper, &m.stop, &edge, &err);
		assert_true(edge.before_mm == 77 && edge.after_mm == 78);
		if (rc != cases[i].rc || !strstr(err.text, cases[i].says))
			fail_msg("case %zu: %d, \"%s\"", i, rc, err.text);
		assert_int_equal(err.code, -rc);
		assert_true(!m.homed && m.v_mm_s == 0);
	}
}

static void it_must_be_powered(void **state)
{
	struct machine m = {.home_at = INCISE_STEPPER_AT_HOME};
	struct incise_error err = {0};

	powered_at(&m, 3);
	m.state = INCISE_STEPPER_DISABLED;
	assert_int_equal(incise_stepper_home(&m.stepper, NULL, &err), -EIO);
	assert_non_null(strstr(err.text, "enable it first"));
	assert_true(m.at_mm == 3);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(the_count_becomes_the_position),
		cmocka_unit_test(the_edge_is_told_in_the_old_count),
		cmocka_unit_test(what_is_wrong_is_said),
		cmocka_unit_test(it_must_be_powered),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
