// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can as a whole against a simulated drive, in virtual time: the conformance tests of
 * every stepper; each fault, also of drives and buses that fail in part, so that one way of
 * noticing is missing; homing by the drive; and no set-point is lost.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include "../device/conformance.h"
#include "rig.h"

#define MS DRIVE_MS
#define COUNTS_PER_MM 12800 /* 51200 a turn of 4 mm */

static struct can_rig rig;

static void failed(const char *text)
{
	fail_msg("%s", text);
}

static void input(void *world, unsigned int input, bool active)
{
	struct can_rig *r = world;
	uint32_t bit = input == INCISE_STEPPER_LINE_ESTOP ? CIA402_INTERLOCK
		       : r->actuator.invert		  ? CIA402_AT_MIN
							  : CIA402_AT_MAX;

	r->drive.inputs = active ? r->drive.inputs | bit : r->drive.inputs & ~bit;
}

static void every_case_of_a_stepper(void **state)
{
	static const struct {
		bool invert, no_homing;
		double jerk_mm_s3;
		uint32_t cycle_ns;
	} row[] = {
		{false, false, 0, 1000000},
		{true, true, 0, 2000000},
		{false, false, 50000, 500000},
	};

	for (size_t k = 0; k < sizeof(row) / sizeof(*row); k++)
		for (int i = 0; conformance[i].name; i++) {
			struct conformance c = {
				.world = &rig,
				.advance = can_rig_advance,
				.input = input,
				/* A quick stop, and the delay of frames both ways. */
				.slack_s = 0.1,
				.say = failed,
			};

			can_rig_init(&rig);
			rig.actuator.invert = row[k].invert;
			rig.actuator.jerk_mm_s3 = row[k].jerk_mm_s3;
			rig.actuator.can.cycle_ns = row[k].cycle_ns;
			if (row[k].no_homing)
				rig.actuator.can.homing_method = 0;
			can_rig_open_or_fail(&rig);
			c.stepper = rig.stepper;
			incise_stepper_info(c.stepper, &c.info);
			conformance[i].run(&c);
			assert_int_equal(rig.drive.enabled_unasked, 0);
			/* A target is a whole count: 1 of a cycle of 0.5 ms. */
			assert_true(rig.drive.fastest <= 10 * COUNTS_PER_MM + 2000);
			can_rig_close(&rig);
			assert_false(drive_powered(&rig.drive));
		}
}

/* Faults under way; each is undone before `clear`. */
static void emcy(struct drive *d, bool on)
{
	if (on)
		drive_fault(d, 0x3210);
}

static void heartbeat(struct drive *d, bool on)
{
	d->no_heartbeat = on;
}

static void tpdo(struct drive *d, bool on)
{
	d->no_tpdo = on;
}

static void unplugged(struct drive *d, bool on)
{
	d->unplugged = on;
}

static void reboot(struct drive *d, bool on)
{
	if (on)
		drive_reboot(d);
}

static void blocked(struct drive *d, bool on)
{
	d->blocked = on;
}

static void bus_off(struct drive *d, bool on)
{
	if (on) {
		drive_bus_off(d);
		return;
	}
	d->unplugged = false;
	d->can_state = CAN_STATE_ERROR_ACTIVE;
	d->send_error = 0;
}

static void queue_full(struct drive *d, bool on)
{
	d->send_error = on ? -ENOBUFS : 0;
}

static void adapter_gone(struct drive *d, bool on)
{
	d->receive_error = d->send_error = on ? -ENODEV : 0;
}

static void other_master(struct drive *d, bool on)
{
	const struct can_frame sync = {.can_id = CANOPEN_SYNC};

	if (on)
		drive_say(d, &sync);
}

static void powered_off(struct drive *d, bool on)
{
	if (on)
		drive_enter(d, CIA402_DISABLED);
}

static void pre_operational(struct drive *d, bool on)
{
	if (on)
		d->nmt = CANOPEN_PRE_OPERATIONAL;
}

static const struct {
	const char *name;
	void (*inject)(struct drive *drive, bool on);
	unsigned int fault;
	const char *says;
} faults[] = {
	{"EMCY", emcy, INCISE_STEPPER_FAULT_ALARM, "(3210h)"},
	{"no heartbeat", heartbeat, INCISE_STEPPER_FAULT_LOST, "no heartbeat from it"},
	{"no TPDO", tpdo, INCISE_STEPPER_FAULT_LOST, "no status (TPDO1)"},
	{"unplugged", unplugged, INCISE_STEPPER_FAULT_LOST, "check its power and cable"},
	{"reboot", reboot, INCISE_STEPPER_FAULT_LOST, "it restarted"},
	{"blocked", blocked, INCISE_STEPPER_FAULT_FOLLOWING, "off its target by"},
	{"bus-off", bus_off, INCISE_STEPPER_FAULT_BUS, "the bus is off"},
	{"queue full", queue_full, INCISE_STEPPER_FAULT_BUS, "queue is full"},
	{"adapter gone", adapter_gone, INCISE_STEPPER_FAULT_BUS, "No such device"},
	{"other master", other_master, INCISE_STEPPER_FAULT_SETPOINT, "another program"},
	{"power taken", powered_off, INCISE_STEPPER_FAULT_ALARM,
	 "left operation enabled"},
	{"NMT", pre_operational, INCISE_STEPPER_FAULT_LOST, "pre-operational"},
};

static void each_fault_stops_the_drive_and_is_named(void **state)
{
	for (size_t i = 0; i < sizeof(faults) / sizeof(*faults); i++) {
		struct incise_stepper_status s;
		struct incise_error err = {0};
		char cause[300];
		uint64_t enables;

		can_rig_init(&rig);
		/* This side detects a blocked drive before the drive does. */
		if (faults[i].inject == blocked)
			rig.drive.od[OD_FOLLOWING].size = 0;
		can_rig_open_or_fail(&rig);
		can_rig_enable_or_fail(&rig);
		can_rig_hold(&rig, 15, 200 * MS);
		assert_true(rig.drive.velocity > 5 * COUNTS_PER_MM);
		faults[i].inject(&rig.drive, true);
		can_rig_hold(&rig, 15, 2000 * MS);
		s = can_rig_look(&rig);
		incise_stepper_cause(rig.stepper, cause, sizeof(cause));
		if (s.state != INCISE_STEPPER_STATE_FAULT ||
		    !(s.faults & faults[i].fault) || !strstr(cause, faults[i].says) ||
		    !strstr(cause, "drive 0x10 at can-test: "))
			fail_msg("%s: %s, faults %#x, \"%s\"", faults[i].name,
				 incise_stepper_state_name(s.state), s.faults, cause);
		/* Stopped, by us or by its own deadman, and without power. */
		if (rig.drive.velocity || drive_powered(&rig.drive))
			fail_msg("%s: it goes on in %s", faults[i].name,
				 cia402_state_name(rig.drive.state));
		enables = rig.drive.enables;
		faults[i].inject(&rig.drive, false);
		assert_int_equal(incise_stepper_enable(rig.stepper, &err), -EPERM);
		assert_true(*err.text);
		can_rig_hold(&rig, 15, 500 * MS);
		assert_int_equal(rig.drive.enables, enables);
		if (incise_stepper_clear(rig.stepper, &err))
			fail_msg("%s: %s", faults[i].name, err.text);
		can_rig_hold(&rig, 15, 500 * MS);
		assert_int_equal(rig.drive.enables, enables);
		can_rig_enable_or_fail(&rig);
		can_rig_hold(&rig, 5, 3000 * MS);
		s = can_rig_look(&rig);
		if (s.faults || fabs(s.position_mm - 5) > 1e-3)
			fail_msg("%s: afterwards %#x at %g mm", faults[i].name, s.faults,
				 s.position_mm);
		assert_int_equal(rig.drive.enabled_unasked, 0);
		can_rig_close(&rig);
	}
}

static void a_program_that_hangs_is_stopped_by_the_drive(void **state)
{
	double at_mm, most_mm;

	can_rig_init(&rig);
	can_rig_open_or_fail(&rig);
	can_rig_enable_or_fail(&rig);
	can_rig_hold(&rig, 15, 300 * MS);
	assert_true(rig.drive.velocity > 5 * COUNTS_PER_MM);
	at_mm = rig.drive.position / COUNTS_PER_MM;
	drive_advance(&rig.drive, 1000 * MS);
	assert_int_equal(rig.drive.velocity, 0);
	assert_false(drive_powered(&rig.drive));
	/*
	 * It continues at the last speed for at most the deadman and a heartbeat, then on
	 * its ramp, which is at least as steep as the profile's: v²/2a = 0.1 mm.
	 */
	most_mm = 10 * (0.1 + 0.025) + 0.1;
	assert_true(rig.drive.position / COUNTS_PER_MM - at_mm <= most_mm);
	/* The program wakes up: nothing moves by itself. */
	can_rig_hold(&rig, 15, 2000 * MS);
	assert_int_equal(can_rig_look(&rig).state, INCISE_STEPPER_STATE_FAULT);
	assert_int_equal(rig.drive.velocity, 0);
	assert_int_equal(rig.drive.enabled_unasked, 0);
	can_rig_close(&rig);
}

/*
 * A program that stood still before a drive that ignores a lost master and holds its place:
 * what it is given afterwards moves nothing.
 */
static void a_program_that_stood_still_does_not_go_on(void **state)
{
	struct incise_stepper_status s;
	char cause[300];
	double at;

	can_rig_init(&rig);
	can_rig_open_or_fail(&rig);
	can_rig_enable_or_fail(&rig);
	can_rig_hold(&rig, 15, 300 * MS);
	assert_true(rig.drive.velocity > 5 * COUNTS_PER_MM);
	rig.drive.watching = false;
	at = rig.drive.position;
	drive_advance(&rig.drive, 3000 * MS);
	assert_true(drive_powered(&rig.drive));
	rig.drive.velocity = 0;
	rig.drive.position = rig.drive.target = at;
	/* Whoever reads the status need not wait for the thread. */
	s = can_rig_look(&rig);
	assert_true(s.faults & INCISE_STEPPER_FAULT_DEADMAN);
	assert_true(incise_stepper_cause(rig.stepper, cause, sizeof(cause)) > 0);
	assert_non_null(strstr(cause, "this program was stopped for 300"));
	assert_int_equal(incise_stepper_set(rig.stepper, 15), -EIO);
	can_rig_hold(&rig, 15, 2000 * MS);
	s = can_rig_look(&rig);
	incise_stepper_cause(rig.stepper, cause, sizeof(cause));
	if (s.state != INCISE_STEPPER_STATE_FAULT ||
	    !(s.faults & INCISE_STEPPER_FAULT_DEADMAN) ||
	    !strstr(cause, "this program was stopped for 300"))
		fail_msg("%s, faults %#x, \"%s\"", incise_stepper_state_name(s.state),
			 s.faults, cause);
	assert_false(drive_powered(&rig.drive));
	/* Its quick stop, and nothing else. */
	assert_true(fabs(rig.drive.position - at) < 0.2 * COUNTS_PER_MM);
	assert_int_equal(rig.drive.enabled_unasked, 0);
	can_rig_close(&rig);
}

/* Off the bus, it uses up all the time that a stop has: disabling waits for that. */
static void disabling_waits_for_the_end_of_a_stop(void **state)
{
	struct incise_error err = {0};

	can_rig_init(&rig);
	rig.actuator.deadman_s = 0.2;
	can_rig_open_or_fail(&rig);
	can_rig_enable_or_fail(&rig);
	can_rig_hold(&rig, 15, 300 * MS);
	pre_operational(&rig.drive, true);
	rig.drive.no_tpdo = true;
	if (incise_stepper_disable(rig.stepper, &err))
		fail_msg("%s", err.text);
	assert_int_equal(can_rig_look(&rig).state, INCISE_STEPPER_STATE_FAULT);
	can_rig_close(&rig);
}

static uint64_t counter(const char *key)
{
	struct incise_stepper_counter c;

	for (int i = 0; !incise_stepper_counter(rig.stepper, i, &c); i++)
		if (!strcmp(c.key, key))
			return c.value;
	fail_msg("there is no counter %s", key);
	return 0;
}

/* 60 s at 1 kHz, each cycle another target. */
static void no_set_point_is_lost(void **state)
{
	uint64_t rpdos, sent;
	int64_t end;

	can_rig_init(&rig);
	can_rig_open_or_fail(&rig);
	can_rig_enable_or_fail(&rig);
	can_rig_hold(&rig, 10, 3000 * MS);
	rpdos = rig.drive.rpdos;
	sent = counter("setpoints_sent");
	end = rig.drive.now_ns + 60000 * MS;
	for (int i = 0; rig.drive.now_ns < end; i++) {
		assert_int_equal(incise_stepper_set(rig.stepper, 10 + 2 * sin(0.002 * i)),
				 0);
		can_rig_advance(&rig, MS);
	}
	/* The last one may still be on its way. */
	drive_advance(&rig.drive, MS / 2);
	assert_int_equal(rig.drive.rpdos - rpdos, counter("setpoints_sent") - sent);
	assert_in_range(rig.drive.rpdos - rpdos, 59990, 60010);
	for (int i = 0; i < 9; i++) {
		struct incise_stepper_counter c;

		assert_int_equal(incise_stepper_counter(rig.stepper, i, &c), 0);
		if (c.trouble && c.value)
			fail_msg("%s: %llu", c.text, (unsigned long long)c.value);
	}
	can_rig_close(&rig);
}

/* The loops closed here reach the target within their limits. */
static void velocities_and_torques_go_there_too(void **state)
{
	static const struct {
		enum incise_actuator_mode mode;
		bool invert;
		double within_mm;
	} cases[] = {
		/* Exactly: an integrator leaves no error. */
		{INCISE_ACTUATOR_CSV, false, 2e-4},
		{INCISE_ACTUATOR_CSV, true, 2e-4},
		/*
		 * Up to the deflection of a spring of stiffness_permille_mm at half a ‰.
		 */
		{INCISE_ACTUATOR_CST, false, 0.02},
		{INCISE_ACTUATOR_CST, true, 0.02},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_stepper_status s;

		can_rig_init(&rig);
		rig.actuator.invert = cases[i].invert;
		rig.actuator.can.mode = cases[i].mode;
		rig.actuator.can.stiffness_permille_mm = 50;
		rig.actuator.can.damping_permille_s_mm = 5;
		rig.actuator.can.torque_max_permille = 300;
		rig.drive.torque_counts_s2 = 0.1 * 1000 * COUNTS_PER_MM / 10;
		can_rig_open_or_fail(&rig);
		can_rig_enable_or_fail(&rig);
		can_rig_hold(&rig, 4, 3000 * MS);
		s = can_rig_look(&rig);
		if (s.faults || fabs(s.position_mm - 4) > cases[i].within_mm)
			fail_msg("case %zu: faults %#x at %g mm", i, s.faults,
				 s.position_mm);
		assert_true((rig.drive.position < 0) == cases[i].invert);
		can_rig_close(&rig);
	}
}

static void start(enum incise_actuator_mode mode, double deadman_s)
{
	struct incise_error err = {0};

	can_rig_init(&rig);
	rig.actuator.deadman_s = deadman_s;
	rig.actuator.can.mode = mode;
	rig.actuator.can.stiffness_permille_mm = 50;
	rig.actuator.can.damping_permille_s_mm = 5;
	rig.actuator.can.torque_max_permille = 300;
	rig.drive.torque_counts_s2 = 0.1 * 1000 * COUNTS_PER_MM / 10;
	if (!can_rig_open(&rig, &err) || incise_stepper_enable(rig.stepper, &err))
		fail_msg("%s", err.text);
	rig.drive.tripped = false;
}

static double at_mm(void)
{
	return rig.drive.position / COUNTS_PER_MM;
}

/* Check that it stopped permanently, for the given reason. */
static void stopped(unsigned int fault, const char *says)
{
	struct incise_stepper_status s;
	char cause[300];

	can_rig_hold(&rig, 10, 3000 * MS);
	s = can_rig_look(&rig);
	incise_stepper_cause(rig.stepper, cause, sizeof(cause));
	if (s.state != INCISE_STEPPER_STATE_FAULT || !(s.faults & fault) ||
	    !strstr(cause, says))
		fail_msg("%s, faults %#x, \"%s\"", incise_stepper_state_name(s.state),
			 s.faults, cause);
	assert_false(drive_powered(&rig.drive));
	assert_int_equal(rig.drive.velocity, 0);
	assert_int_equal(rig.drive.enabled_unasked, 0);
}

/* A loop closed here opens without answers, however long the deadman is. */
static void silence_of_the_drive_moves_nothing(void **state)
{
	for (int mode = INCISE_ACTUATOR_CSP; mode <= INCISE_ACTUATOR_CST; mode++)
		for (int k = 0; k < 2; k++) {
			start((enum incise_actuator_mode)mode, k ? 1.0 : 0.1);
			can_rig_hold(&rig, 4, 300 * MS);
			rig.drive.no_tpdo = true;
			can_rig_hold(&rig, 4, 3000 * MS);
			/*
			 * It moves at most to its target; a swing in torque mode runs
			 * out.
			 */
			assert_true(at_mm() < (mode == INCISE_ACTUATOR_CST ? 5 : 4.01));
			assert_true(at_mm() > 0);
			rig.drive.no_tpdo = mode == INCISE_ACTUATOR_CSP;
			stopped(INCISE_STEPPER_FAULT_LOST, "no status (TPDO1)");
			can_rig_close(&rig);
		}
}

/* It receives no set-points, but sends heartbeats and its position. */
static void a_drive_that_does_not_obey_is_left_to_its_own_watch(void **state)
{
	for (int mode = INCISE_ACTUATOR_CSP; mode <= INCISE_ACTUATOR_CSV; mode++) {
		double from_mm;

		start((enum incise_actuator_mode)mode, 0.1);
		can_rig_hold(&rig, 10, 300 * MS);
		from_mm = at_mm();
		rig.drive.od[OD_RPDO1_COB].value |= 0x80000000u;
		can_rig_hold(&rig, from_mm, 1000 * MS);
		assert_int_equal(rig.drive.velocity, 0);
		/*
		 * In csv it continues at 10 mm/s for following_mm and following_ms, then
		 * 20 ms without obeying, then the 100 ms of its own watch and a
		 * heartbeat; the targets continue for v²/2a, and its ramp takes as much.
		 */
		assert_true(at_mm() - from_mm <
			    1 + 10 * (0.05 + 0.02 + 0.125) + 2 * 0.1 + 0.1);
		stopped(INCISE_STEPPER_FAULT_FOLLOWING | INCISE_STEPPER_FAULT_LOST |
				INCISE_STEPPER_FAULT_ALARM,
			"drive 0x10 at can-test: ");
		can_rig_close(&rig);
	}
}

static int (*all_sent)(struct can_bus *bus, const struct can_frame *frame);

static int no_sync(struct can_bus *bus, const struct can_frame *frame)
{
	return frame->can_id == CANOPEN_SYNC ? -ENOBUFS : all_sent(bus, frame);
}

/* A queue that empties by a frame per cycle has room for set-points, not for SYNCs. */
static void a_set_point_without_its_sync_is_none(void **state)
{
	static struct can_bus_ops ops;
	const struct can_bus_ops *before;
	double from_mm;

	start(INCISE_ACTUATOR_CSV, 0.1);
	can_rig_hold(&rig, 10, 300 * MS);
	before = rig.drive.bus.ops;
	ops = *before;
	all_sent = ops.send;
	ops.send = no_sync;
	rig.drive.bus.ops = &ops;
	from_mm = at_mm();
	can_rig_hold(&rig, 5, 1000 * MS);
	/* Its own watch, and a heartbeat that was on its way. */
	assert_true(at_mm() - from_mm < 10 * 0.125 + 0.3);
	rig.drive.bus.ops = before;
	stopped(INCISE_STEPPER_FAULT_BUS, "queue is full");
	can_rig_close(&rig);
}

/* The PDO that would report the e-stop stops. */
static void inputs_that_fall_silent_are_a_fault(void **state)
{
	start(INCISE_ACTUATOR_CSP, 0.1);
	can_rig_hold(&rig, 10, 300 * MS);
	assert_int_equal(can_rig_look(&rig).faults, 0);
	rig.drive.od[OD_TPDO2_COB].value |= 0x80000000u;
	can_rig_hold(&rig, 10, 400 * MS);
	stopped(INCISE_STEPPER_FAULT_LOST, "no inputs (TPDO2)");
	can_rig_close(&rig);
	/* A drive without the event timer gives no such indication. */
	can_rig_init(&rig);
	rig.drive.od[OD_TPDO2_TIMER].size = 0;
	assert_non_null(can_rig_open(&rig, NULL));
	assert_int_equal(incise_stepper_enable(rig.stepper, NULL), 0);
	can_rig_hold(&rig, 10, 1000 * MS);
	assert_int_equal(can_rig_look(&rig).faults, 0);
	can_rig_close(&rig);
}

/* Another program gives it power. */
static void power_that_nobody_gave_is_a_fault(void **state)
{
	struct incise_error err = {0};

	start(INCISE_ACTUATOR_CSP, 0.1);
	assert_int_equal(incise_stepper_disable(rig.stepper, NULL), 0);
	drive_enter(&rig.drive, CIA402_ENABLED);
	can_rig_advance(&rig, 1000 * MS);
	assert_int_equal(can_rig_look(&rig).state, INCISE_STEPPER_STATE_FAULT);
	/* And its watch ends that. */
	assert_false(drive_powered(&rig.drive));
	if (incise_stepper_clear(rig.stepper, &err))
		fail_msg("%s", err.text);
	rig.drive.tripped = false;
	if (incise_stepper_enable(rig.stepper, &err))
		fail_msg("%s", err.text);
	can_rig_close(&rig);
}

/* The shortest accepted deadman: it must not expire at rest. */
static void the_shortest_deadman_holds_at_rest(void **state)
{
	struct incise_error err = {0};

	can_rig_init(&rig);
	rig.actuator.deadman_s = 0.02;
	assert_non_null(can_rig_open(&rig, &err));
	for (int i = 0; i < 3; i++) {
		can_rig_advance(&rig, 2000 * MS);
		rig.drive.tripped = false;
		if (incise_stepper_enable(rig.stepper, &err))
			fail_msg("%s", err.text);
		assert_int_equal(incise_stepper_disable(rig.stepper, NULL), 0);
	}
	assert_int_equal(rig.drive.quick_stops, 0);
	can_rig_close(&rig);
}

static double gives_way_mm;

/* Its brake opens while it gets power. */
static int give_way(struct can_bus *bus, const struct can_frame *frame)
{
	struct drive *d = &rig.drive;

	if (d->enabling && d->enabled_at_ns - d->now_ns < 25 * MS) {
		d->position += gives_way_mm * COUNTS_PER_MM;
		d->target = d->position;
		gives_way_mm = 0;
	}
	return all_sent(bus, frame);
}

static void one_that_gives_way_gets_no_jump(void **state)
{
	static const double way_mm[] = {-0.3, -2, 0.005};
	static struct can_bus_ops ops;

	for (size_t i = 0; i < sizeof(way_mm) / sizeof(*way_mm); i++) {
		struct incise_error err = {0};

		can_rig_init(&rig);
		rig.drive.enable_ns = 50 * MS;
		assert_non_null(can_rig_open(&rig, &err));
		ops = *rig.drive.bus.ops;
		all_sent = ops.send;
		ops.send = give_way;
		rig.drive.bus.ops = &ops;
		gives_way_mm = way_mm[i];
		assert_int_equal(incise_stepper_enable(rig.stepper, &err),
				 way_mm[i] < 0 ? -ERANGE : 0);
		assert_true(gives_way_mm == 0);
		can_rig_advance(&rig, 2000 * MS);
		/*
		 * Each target is within a cycle at 10 mm/s, and rounding, of its
		 * position.
		 */
		assert_true(rig.drive.fastest <= 10 * COUNTS_PER_MM + 2000);
		assert_false(drive_powered(&rig.drive));
		can_rig_close(&rig);
	}
}

static void it_homes_by_itself(void **state)
{
	static const double home_mm[] = {0, -0.5, 1.5};

	for (size_t i = 0; i < sizeof(home_mm) / sizeof(*home_mm); i++) {
		struct incise_stepper_edge_found edge = {0, 0};
		struct incise_stepper_status s;
		struct incise_error err = {0};

		can_rig_init(&rig);
		rig.actuator.home_mm = home_mm[i];
		can_rig_open_or_fail(&rig);
		assert_false(can_rig_look(&rig).homed);
		can_rig_enable_or_fail(&rig);
		if (incise_stepper_home(rig.stepper, NULL, &edge, &err))
			fail_msg("%s", err.text);
		s = can_rig_look(&rig);
		assert_true(s.homed && s.state == INCISE_STEPPER_STATE_READY &&
			    !s.faults);
		assert_true(isnan(edge.before_mm) && edge.after_mm == home_mm[i]);
		assert_true(fabs(s.position_mm - fmax(0, home_mm[i])) < 1e-3);
		/* The drive's own 0 is at its switch, that is at home_mm. */
		assert_true(fabs(rig.drive.position / COUNTS_PER_MM -
				 (fmax(0, home_mm[i]) - home_mm[i])) < 1e-3);
		assert_int_equal((int32_t)rig.drive.od[OD_RANGE_MIN].value,
				 (int32_t)lround(COUNTS_PER_MM *
						 (fmin(0, home_mm[i]) - home_mm[i] - 1)));
		can_rig_close(&rig);
		/* The next program reads it from the drive. */
		can_rig_open_or_fail(&rig);
		assert_true(can_rig_look(&rig).homed);
		can_rig_close(&rig);
		/* A reboot clears it. */
		drive_reboot(&rig.drive);
		can_rig_open_or_fail(&rig);
		assert_false(can_rig_look(&rig).homed);
		can_rig_close(&rig);
	}
}

static void homing_can_fail_and_be_stopped(void **state)
{
	volatile int stop = 0;
	struct incise_error err = {0};

	can_rig_init(&rig);
	can_rig_open_or_fail(&rig);
	assert_int_equal(incise_stepper_home(rig.stepper, NULL, NULL, &err), -EIO);
	assert_non_null(strstr(err.text, "it is off"));
	can_rig_enable_or_fail(&rig);
	rig.drive.homing_fails = true;
	assert_int_equal(incise_stepper_home(rig.stepper, NULL, NULL, &err), -EIO);
	assert_non_null(strstr(err.text, "its homing failed"));
	assert_false(drive_powered(&rig.drive));
	assert_false(can_rig_look(&rig).homed);
	assert_int_equal(incise_stepper_enable(rig.stepper, &err), -EPERM);
	rig.drive.homing_fails = false;
	assert_int_equal(incise_stepper_clear(rig.stepper, &err), 0);
	can_rig_enable_or_fail(&rig);
	/* An earlier failure does not count again, here or in the next program. */
	assert_int_equal(incise_stepper_home(rig.stepper, NULL, NULL, &err), 0);
	assert_true(can_rig_look(&rig).homed);
	rig.drive.homing_fails = true;
	assert_int_equal(incise_stepper_home(rig.stepper, NULL, NULL, &err), -EIO);
	assert_false(can_rig_look(&rig).homed);
	can_rig_close(&rig);
	rig.drive.homing_fails = false;
	can_rig_open_or_fail(&rig);
	assert_false(can_rig_look(&rig).homed);
	can_rig_enable_or_fail(&rig);
	assert_int_equal(incise_stepper_home(rig.stepper, NULL, NULL, &err), 0);
	stop = 1;
	assert_int_equal(incise_stepper_home(rig.stepper, &stop, NULL, &err), -EINTR);
	assert_false(drive_powered(&rig.drive));
	assert_int_equal(can_rig_look(&rig).faults, 0);
	can_rig_enable_or_fail(&rig);
	can_rig_close(&rig);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(every_case_of_a_stepper),
		cmocka_unit_test(each_fault_stops_the_drive_and_is_named),
		cmocka_unit_test(a_program_that_hangs_is_stopped_by_the_drive),
		cmocka_unit_test(a_program_that_stood_still_does_not_go_on),
		cmocka_unit_test(disabling_waits_for_the_end_of_a_stop),
		cmocka_unit_test(no_set_point_is_lost),
		cmocka_unit_test(velocities_and_torques_go_there_too),
		cmocka_unit_test(silence_of_the_drive_moves_nothing),
		cmocka_unit_test(a_drive_that_does_not_obey_is_left_to_its_own_watch),
		cmocka_unit_test(a_set_point_without_its_sync_is_none),
		cmocka_unit_test(inputs_that_fall_silent_are_a_fault),
		cmocka_unit_test(power_that_nobody_gave_is_a_fault),
		cmocka_unit_test(the_shortest_deadman_holds_at_rest),
		cmocka_unit_test(one_that_gives_way_gets_no_jump),
		cmocka_unit_test(it_homes_by_itself),
		cmocka_unit_test(homing_can_fail_and_be_stopped),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
