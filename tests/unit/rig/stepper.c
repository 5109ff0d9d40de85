// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/rig/stepper.c: calls reach the backend; homing makes the count of a simulated machine the
 * position of the machine, wherever it started, or reports why not and stops it.
 */
#include "../unit.h"
#include <incise/backend.h>

/* --- stepper --- */

/* A backend that remembers what it was called with. */
struct fake {
	struct incise_stepper stepper;
	double position_mm;
};

static int fake_set(struct incise_stepper *stepper, double position_mm)
{
	((struct fake *)stepper)->position_mm = position_mm;
	return -EDOM;
}

static int fake_status(struct incise_stepper *stepper,
		       struct incise_stepper_status *status)
{
	status->position_mm = ((struct fake *)stepper)->position_mm;
	return -EIO;
}

static int fake_jog(struct incise_stepper *stepper, double velocity_mm_s)
{
	((struct fake *)stepper)->position_mm = velocity_mm_s;
	return -ENODEV;
}

static int fake_enable(struct incise_stepper *stepper, struct incise_error *err)
{
	((struct fake *)stepper)->position_mm = 1;
	return incise_error_set(err, EPERM, "clear it");
}

static int fake_disable(struct incise_stepper *stepper, struct incise_error *err)
{
	((struct fake *)stepper)->position_mm = 2;
	return incise_error_set(err, ETIMEDOUT, "it moves");
}

static int fake_clear(struct incise_stepper *stepper, struct incise_error *err)
{
	((struct fake *)stepper)->position_mm = 3;
	return incise_error_set(err, EBUSY, "the e-stop is active");
}

static void fake_info(const struct incise_stepper *stepper,
		      struct incise_stepper_info *info)
{
	info->travel_mm = ((const struct fake *)stepper)->position_mm;
}

TEST(calls_reach_the_backend)
{
	static const struct incise_stepper_ops ops = {
		.set = fake_set,
		.jog = fake_jog,
		.status = fake_status,
		.enable = fake_enable,
		.disable = fake_disable,
		.clear = fake_clear,
		.info = fake_info,
	};
	struct fake fake = {.stepper.ops = &ops};
	struct incise_stepper_status status = {0};
	struct incise_stepper_info info = {0};

	assert_int_equal(incise_stepper_set(&fake.stepper, 1.25), -EDOM);
	assert_true(fake.position_mm == 1.25);
	assert_int_equal(incise_stepper_status(&fake.stepper, &status), -EIO);
	assert_true(status.position_mm == 1.25);
	incise_stepper_info(&fake.stepper, &info);
	assert_true(info.travel_mm == 1.25);
	assert_int_equal(incise_stepper_jog(&fake.stepper, -2.5), -ENODEV);
	assert_true(fake.position_mm == -2.5);
	assert_error(incise_stepper_enable(&fake.stepper, &err), EPERM, &err, "clear it");
	assert_true(fake.position_mm == 1);
	assert_int_equal(incise_stepper_disable(&fake.stepper, &err), -ETIMEDOUT);
	assert_true(fake.position_mm == 2);
	assert_int_equal(incise_stepper_clear(&fake.stepper, &err), -EBUSY);
	assert_true(fake.position_mm == 3);
}

static void named_info(const struct incise_stepper *stepper,
		       struct incise_stepper_info *info)
{
	*info = (struct incise_stepper_info){.name = "a simple one"};
}

TEST(what_a_backend_has_not_is_said)
{
	static const struct incise_stepper_ops ops = {.info = named_info};
	struct incise_stepper stepper = {.ops = &ops};

	assert_int_equal(incise_stepper_jog(&stepper, 1), -EOPNOTSUPP);
	for (int i = 0; i < 4; i++) {
		err = (struct incise_error){0};
		assert_int_equal(i == 0	  ? incise_stepper_enable(&stepper, &err)
				 : i == 1 ? incise_stepper_disable(&stepper, &err)
				 : i == 2 ? incise_stepper_clear(&stepper, &err)
					  : incise_stepper_home(&stepper, NULL, NULL,
								&err),
				 -EOPNOTSUPP);
		assert_int_equal(err.code, EOPNOTSUPP);
		assert_says(err.text, "a simple one");
	}
}

TEST(states_and_faults_have_words)
{
	static const char *const states[] = {"disabled", "ready", "moving",
					     "stopping", "fault", "unknown"};
	const char *seen[INCISE_STEPPER_FAULTS + 1];

	for (int i = 0; i < 6; i++)
		assert_string_equal(incise_stepper_state_name(i), states[i]);
	/* One for each bit, all different; the one beyond is unknown. */
	for (int i = 0; i <= INCISE_STEPPER_FAULTS; i++) {
		seen[i] = incise_stepper_fault_text(1u << i);
		assert_true(!!strstr(seen[i], "unknown") == (i == INCISE_STEPPER_FAULTS));
		for (int j = 0; j < i; j++)
			assert_string_not_equal(seen[i], seen[j]);
	}
}

/* A stepper that may describe its fault, and has two counts. */
struct teller {
	struct incise_stepper stepper;
	unsigned int faults;
	const char *cause;
};

static int teller_status(struct incise_stepper *stepper,
			 struct incise_stepper_status *status)
{
	*status = (struct incise_stepper_status){
		.faults = ((struct teller *)stepper)->faults};
	return 0;
}

static int teller_cause(struct incise_stepper *stepper, char *text, size_t size)
{
	const char *cause = ((struct teller *)stepper)->cause;

	return cause ? snprintf(text, size, "%s", cause) : 0;
}

static int teller_counter(struct incise_stepper *stepper, int i,
			  struct incise_stepper_counter *counter)
{
	static const struct incise_stepper_counter counters[] = {
		{"sync_late", "SYNCs sent late", 3, true},
		{"setpoints", "setpoints sent", 0, false}};

	if (i > 1)
		return -ENOENT;
	*counter = counters[i];
	return 0;
}

TEST(the_cause_is_the_device_s_own_or_the_first_fault)
{
	static const struct incise_stepper_ops ops[] = {
		{.status = teller_status},
		{.status = teller_status, .cause = teller_cause},
	};
	static const struct {
		unsigned int faults;
		const char *cause, *says; /* says: the beginning, without a cause */
	} cases[] = {
		{0, NULL, ""},
		{INCISE_STEPPER_FAULT_BUS | INCISE_STEPPER_FAULT_LOST, NULL,
		 "the bus to the drive"},
		/* What stopped nothing is said only where there is nothing else. */
		{INCISE_STEPPER_FAULT_TRAVEL, NULL, "travel: "},
		{INCISE_STEPPER_FAULT_TRAVEL | INCISE_STEPPER_FAULT_ALARM, NULL,
		 "alarm of"},
		{INCISE_STEPPER_FAULT_ALARM, "short circuit (2320h)", "alarm of"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++)
		for (size_t k = 0; k < 2; k++) {
			const char *own = k ? cases[i].cause : NULL;
			const char *says = own ? own : cases[i].says;
			struct teller teller = {{&ops[k]}, cases[i].faults, own};
			char text[200] = "untouched", little[8];
			int length = incise_stepper_cause(&teller.stepper, text, 200);

			assert_int_equal(length, strlen(text));
			assert_true(!*text == !*says);
			assert_memory_equal(text, says, strlen(says));
			/* Cut to what there is room for, as snprintf(3) does. */
			assert_int_equal(incise_stepper_cause(&teller.stepper, little,
							      sizeof(little)),
					 length);
			assert_int_equal(strncmp(little, text, sizeof(little) - 1), 0);
			assert_true(strlen(little) < sizeof(little));
		}
}

TEST(counters_are_the_backend_s)
{
	static const struct incise_stepper_ops ops = {.counter = teller_counter}, none;
	struct teller teller = {.stepper.ops = &ops};
	struct incise_stepper stepper = {.ops = &none};
	struct incise_stepper_counter counter = {0};

	assert_int_equal(incise_stepper_counter(&teller.stepper, 0, &counter), 0);
	assert_string_equal(counter.key, "sync_late");
	assert_true(counter.value == 3 && counter.trouble);
	assert_int_equal(incise_stepper_counter(&teller.stepper, 1, &counter), 0);
	assert_string_equal(counter.key, "setpoints");
	assert_int_equal(incise_stepper_counter(&teller.stepper, 2, &counter), -ENOENT);
	assert_int_equal(incise_stepper_counter(&teller.stepper, -1, &counter), -ENOENT);
	assert_int_equal(incise_stepper_counter(&stepper, 0, &counter), -ENOENT);
}

/* --- home --- */

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
	const char *cause; /* its description of the fault; or NULL */

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
	return m->state == INCISE_STEPPER_STATE_READY ||
	       m->state == INCISE_STEPPER_STATE_MOVING;
}

static void halt(struct machine *m, unsigned int fault)
{
	m->faults |= fault;
	m->v_mm_s = 0;
	m->homed = false;
	m->state = INCISE_STEPPER_STATE_FAULT;
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
	if (m->home_at == INCISE_STEPPER_LINE_LIMIT_MIN && touches(m) && m->v_mm_s < 0) {
		halt(m, INCISE_STEPPER_FAULT_LIMIT_MIN);
		return;
	}
	m->at_mm += m->v_mm_s * dt;
	m->state = m->v_mm_s ? INCISE_STEPPER_STATE_MOVING : INCISE_STEPPER_STATE_READY;
}

static int machine_wait(struct incise_stepper *stepper, int64_t ns)
{
	struct machine *m = of(stepper);

	for (int64_t end = m->t_ns + ns; m->t_ns < end; m->t_ns += 100000) {
		bool before = m->touched;

		if (powered(m) && m->t_ns - m->set_ns > 50000000)
			halt(m, INCISE_STEPPER_FAULT_DEADMAN);
		if (powered(m) && m->estop && m->polls > 100)
			halt(m, INCISE_STEPPER_FAULT_ESTOP);
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
	m->state = INCISE_STEPPER_STATE_READY;
	return machine_take(m, position(m), false);
}

static int machine_clear(struct incise_stepper *stepper, struct incise_error *err)
{
	of(stepper)->faults = 0;
	of(stepper)->state = INCISE_STEPPER_STATE_DISABLED;
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

	*homing = (struct incise_stepper_homing){SPEED_MM_S, SPEED_MM_S / 10, 0.2,
						 m->home_mm, m->home_at};
	return m->home_at ? 0 : -EOPNOTSUPP;
}

static int machine_edge(struct incise_stepper *stepper, struct incise_stepper_edge *edge)
{
	struct machine *m = of(stepper);

	*edge = (struct incise_stepper_edge){0};
	if (m->home_at == INCISE_STEPPER_LINE_HOME)
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

TEST(the_count_becomes_the_position)
{
	static const double starts_mm[] = {0.01, 3, 11.7, 19.9, -1, 22};
	static const struct {
		unsigned int home_at;
		double edge_mm, end_mm, home_mm;
	} cases[] = {
		{INCISE_STEPPER_LINE_HOME, 0, -9, 0},
		{INCISE_STEPPER_LINE_HOME, 0, -9, 1.5},
		{INCISE_STEPPER_LINE_HOME, 0, -9, -0.25},
		/* A mark that is gone between two polls at full speed. */
		{INCISE_STEPPER_LINE_HOME, 0, -0.003, 0},
		{INCISE_STEPPER_LINE_LIMIT_MIN, 0, -9, 0},
		{INCISE_STEPPER_LINE_LIMIT_MIN, 0, -9, -0.5},
		{INCISE_STEPPER_LINE_LIMIT_MIN, 0, -9, 0.75},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++)
		for (size_t k = 0; k < sizeof(starts_mm) / sizeof(*starts_mm); k++) {
			struct machine m = {
				.home_at = cases[i].home_at,
				.edge_mm = cases[i].edge_mm,
				.end_mm = cases[i].end_mm,
				.home_mm = cases[i].home_mm,
			};
			double rest_mm = fmax(0, m.home_mm), off;
			int rc;

			/* Below a mark there is nothing to be found. */
			if (m.end_mm > starts_mm[k])
				continue;
			powered_at(&m, starts_mm[k]);
			rc = incise_stepper_home(&m.stepper, &m.stop, NULL, &err);
			if (rc)
				fail_msg("case %zu from %g mm: %s", i, starts_mm[k],
					 err.text);
			assert_true(m.homed && m.state == INCISE_STEPPER_STATE_READY);
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

/* The count at the edge, read before homing names places again; as well as homing reads. */
TEST(the_edge_is_told_in_the_old_count)
{
	static const unsigned int inputs[] = {INCISE_STEPPER_LINE_HOME,
					      INCISE_STEPPER_LINE_LIMIT_MIN};
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
			assert_int_equal(
				incise_stepper_home(&m.stepper, &m.stop, &edge, NULL), 0);
			assert_true(edge.after_mm == 2);
			if (!(fabs(edge.before_mm - was_mm) < 0.0005 + 0.00005 + STEP_MM))
				fail_msg("input %u, %g mm lost: %g, was %g", inputs[i],
					 lost_mm[k], edge.before_mm, was_mm);
		}
	}
}

TEST(what_is_wrong_is_said)
{
	static const struct {
		struct machine m;
		int code;
		const char *says;
	} cases[] = {
		{{.home_at = 0}, EOPNOTSUPP, "home input"},
		{{.home_at = INCISE_STEPPER_LINE_HOME, .stuck_off = true},
		 EIO,
		 "within the travel"},
		{{.home_at = INCISE_STEPPER_LINE_HOME, .stuck_on = true},
		 EIO,
		 "stays active"},
		{{.home_at = INCISE_STEPPER_LINE_HOME, .end_mm = -9, .estop = true},
		 EIO,
		 "e-stop:"},
		{{.home_at = INCISE_STEPPER_LINE_HOME,
		  .end_mm = -9,
		  .estop = true,
		  .cause = "safe torque off (5441h)"},
		 EIO,
		 "(5441h)"},
		{{.home_at = INCISE_STEPPER_LINE_HOME, .end_mm = -9, .deaf = true},
		 ETIMEDOUT,
		 "not done in time"},
		{{.home_at = INCISE_STEPPER_LINE_HOME, .end_mm = -9, .stop_at = 50},
		 EINTR,
		 "stopped"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct machine m = cases[i].m;
		struct incise_stepper_edge_found edge = {77, 78};

		powered_at(&m, 10);
		assert_error(incise_stepper_home(&m.stepper, &m.stop, &edge, &err),
			     cases[i].code, &err, cases[i].says);
		assert_true(edge.before_mm == 77 && edge.after_mm == 78);
		assert_true(!m.homed && m.v_mm_s == 0);
	}
}

TEST(it_must_be_powered)
{
	struct machine m = {.home_at = INCISE_STEPPER_LINE_HOME};

	powered_at(&m, 3);
	m.state = INCISE_STEPPER_STATE_DISABLED;
	assert_error(incise_stepper_home(&m.stepper, NULL, NULL, &err), EIO, &err,
		     "enable");
	assert_true(m.at_mm == 3);
}
