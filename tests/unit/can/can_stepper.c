// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can as a whole against a simulated drive, in virtual time: the conformance tests of
 * every stepper; each fault, also of drives and buses that fail in part, so that one way of
 * noticing is missing; homing by the drive; and no set-point is lost.
 */
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "../cases.h"
#include "../rig/conformance.h"
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

TEST(every_case_of_a_stepper)
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

static void start(enum incise_actuator_mode mode, double deadman_s)
{
	can_rig_init(&rig);
	rig.actuator.deadman_s = deadman_s;
	rig.actuator.can.mode = mode;
	rig.actuator.can.stiffness_permille_mm = 50;
	rig.actuator.can.damping_permille_s_mm = 5;
	rig.actuator.can.torque_max_permille = 300;
	rig.drive.torque_counts_s2 = 0.1 * 1000 * COUNTS_PER_MM / 10;
}

static void go(void)
{
	can_rig_open_or_fail(&rig);
	can_rig_enable_or_fail(&rig);
	can_rig_hold(&rig, 15, 300 * MS);
	assert_true(rig.drive.velocity > 5 * COUNTS_PER_MM);
}

static double at_mm(void)
{
	return rig.drive.position / COUNTS_PER_MM;
}

/* It stopped permanently, for the given reason, without power. */
static void stopped(const char *name, unsigned int fault, const char *says)
{
	struct incise_stepper_status s = can_rig_look(&rig);
	char cause[300];

	incise_stepper_cause(rig.stepper, cause, sizeof(cause));
	if (s.state != INCISE_STEPPER_STATE_FAULT || !(s.faults & fault) ||
	    !strstr(cause, says) || !strstr(cause, "drive 0x10 at can-test: "))
		fail_msg("%s: %s, faults %#x, \"%s\"", name,
			 incise_stepper_state_name(s.state), s.faults, cause);
	if (rig.drive.velocity || drive_powered(&rig.drive))
		fail_msg("%s: it goes on in %s", name,
			 cia402_state_name(rig.drive.state));
	assert_int_equal(rig.drive.enabled_unasked, 0);
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

/* A queue that empties by a frame per cycle has room for set-points, not for SYNCs. */
static void no_sync(struct drive *d, bool on)
{
	d->sync_error = on ? -ENOBUFS : 0;
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

/* It receives no set-points, but sends heartbeats and its position. */
static void disobeys(struct drive *d, bool on)
{
	if (on)
		d->od[OD_RPDO1_COB].value |= 0x80000000;
}

/* The PDO that would report the e-stop stops. */
static void no_inputs(struct drive *d, bool on)
{
	if (on)
		d->od[OD_TPDO2_COB].value |= 0x80000000;
}

#define CSP INCISE_ACTUATOR_CSP
#define CSV INCISE_ACTUATOR_CSV
#define CST INCISE_ACTUATOR_CST
#define ALARM INCISE_STEPPER_FAULT_ALARM
#define LOST INCISE_STEPPER_FAULT_LOST
#define BUS INCISE_STEPPER_FAULT_BUS
#define FOLLOWING INCISE_STEPPER_FAULT_FOLLOWING

/*
 * It goes 10 mm/s, and a ramp takes 0.1 mm. This side's own watch of heartbeats and status is the
 * deadman and a half, and at most 20 ms where the loop is closed here; the drive's is the deadman
 * and a heartbeat, a quarter of it.
 */
static const struct {
	const char *name;
	void (*inject)(struct drive *drive, bool on);
	unsigned int fault;
	const char *says;
	enum incise_actuator_mode mode;
	double deadman_s, most_mm; /* that it goes on */
} faults[] = {
	{"EMCY", emcy, ALARM, "(3210h)", CSP, 0.1, 0},
	{"no heartbeat", heartbeat, LOST, "heartbeat", CSP, 0.1, 10 * 0.18 + 0.2},
	{"unplugged", unplugged, LOST, "", CSP, 0.1, 10 * 0.18 + 0.2},
	{"reboot", reboot, LOST, "restarted", CSP, 0.1, 0},
	{"blocked", blocked, FOLLOWING, "off its target", CSP, 0.1, 0},
	{"bus-off", bus_off, BUS, "bus is off", CSP, 0.1, 10 * 0.125 + 0.2},
	{"queue full", queue_full, BUS, "queue is full", CSP, 0.1, 10 * 0.125 + 0.2},
	{"adapter gone", adapter_gone, BUS, "No such device", CSP, 0.1, 10 * 0.125 + 0.2},
	{"other master", other_master, INCISE_STEPPER_FAULT_SETPOINT, "another program",
	 CSP, 0.1, 0.2},
	{"power taken", powered_off, ALARM, "operation enabled", CSP, 0.1, 0},
	{"NMT", pre_operational, LOST, "pre-operational", CSP, 0.1, 10 * 0.125 + 0.2},
	/* A loop closed here opens without answers, however long the deadman is. */
	{"no TPDO", tpdo, LOST, "TPDO1", CSP, 0.1, 10 * 0.18 + 0.2},
	{"no TPDO", tpdo, LOST, "TPDO1", CSP, 1, 10 * 1.8 + 0.2},
	{"no TPDO, csv", tpdo, LOST, "TPDO1", CSV, 0.1, 10 * 0.125 + 0.2},
	{"no TPDO, csv", tpdo, LOST, "TPDO1", CSV, 1, 10 * 0.125 + 0.2},
	{"no TPDO, cst", tpdo, LOST, "TPDO1", CST, 0.1, 10 * 0.125 + 0.2},
	{"no TPDO, cst", tpdo, LOST, "TPDO1", CST, 1, 10 * 0.125 + 0.2},
	/* It is left to its own watch: in csv after following_mm and _ms, and 20 ms more. */
	{"disobeys", disobeys, FOLLOWING | LOST | ALARM, "", CSP, 0.1, 0.1},
	{"disobeys, csv", disobeys, FOLLOWING | LOST | ALARM, "", CSV, 0.1,
	 1 + 10 * (0.05 + 0.02 + 0.125) + 0.2},
	{"no SYNC", no_sync, BUS, "queue is full", CSV, 0.1, 10 * 0.125 + 0.3},
	{"no inputs", no_inputs, LOST, "TPDO2", CSP, 0.1, 10 * 0.4 + 0.2},
};

TEST(each_fault_stops_the_drive_and_is_named)
{
	for (size_t i = 0; i < sizeof(faults) / sizeof(*faults); i++) {
		struct incise_stepper_status s;
		struct incise_error err = {0};
		uint64_t enables;
		double from_mm;

		start(faults[i].mode, faults[i].deadman_s);
		go();
		from_mm = at_mm();
		faults[i].inject(&rig.drive, true);
		/* One that disobeys shows it where it ought to stop, or to go. */
		if (faults[i].inject == disobeys)
			can_rig_hold(&rig, from_mm, 1000 * MS);
		can_rig_hold(&rig, 15, 6000 * MS);
		/* A reboot sets its count to 0. */
		if (at_mm() - from_mm > faults[i].most_mm + 1e-6)
			fail_msg("%s: it went on for %g mm", faults[i].name,
				 at_mm() - from_mm);
		stopped(faults[i].name, faults[i].fault, faults[i].says);
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
		if (s.faults ||
		    fabs(s.position_mm - 5) > (faults[i].mode == CST ? 0.02 : 1e-3))
			fail_msg("%s: afterwards %#x at %g mm", faults[i].name, s.faults,
				 s.position_mm);
		assert_int_equal(rig.drive.enabled_unasked, 0);
		can_rig_close(&rig);
	}
	/* A drive without the event timer does not say that inputs are silent. */
	start(CSP, 0.1);
	rig.drive.od[OD_TPDO2_TIMER].size = 0;
	go();
	can_rig_hold(&rig, 10, 1000 * MS);
	assert_int_equal(can_rig_look(&rig).faults, 0);
	can_rig_close(&rig);
}

TEST(a_program_that_hangs_is_stopped_by_the_drive)
{
	double from_mm;

	start(CSP, 0.1);
	go();
	from_mm = at_mm();
	drive_advance(&rig.drive, 1000 * MS);
	assert_int_equal(rig.drive.velocity, 0);
	assert_false(drive_powered(&rig.drive));
	assert_true(at_mm() - from_mm <= 10 * (0.1 + 0.025) + 0.1);
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
TEST(a_program_that_stood_still_does_not_go_on)
{
	char cause[300];
	double from_mm;

	start(CSP, 0.1);
	go();
	rig.drive.watching = false;
	drive_advance(&rig.drive, 3000 * MS);
	assert_true(drive_powered(&rig.drive));
	from_mm = at_mm();
	/* Whoever reads the status need not wait for the thread. */
	assert_true(can_rig_look(&rig).faults & INCISE_STEPPER_FAULT_DEADMAN);
	assert_true(incise_stepper_cause(rig.stepper, cause, sizeof(cause)) > 0);
	assert_non_null(strstr(cause, "stopped for 300"));
	assert_int_equal(incise_stepper_set(rig.stepper, 15), -EIO);
	can_rig_hold(&rig, 15, 2000 * MS);
	stopped("stood still", INCISE_STEPPER_FAULT_DEADMAN, "stopped for 300");
	assert_true(fabs(at_mm() - from_mm) < 1e-3);
	can_rig_close(&rig);
}

/* Off the bus, it uses up all the time that a stop has: disabling waits for that. */
TEST(disabling_waits_for_the_end_of_a_stop)
{
	start(CSP, 0.2);
	go();
	pre_operational(&rig.drive, true);
	rig.drive.no_tpdo = true;
	succeeds(!incise_stepper_disable(rig.stepper, &err));
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
TEST(no_set_point_is_lost)
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
TEST(velocities_and_torques_go_there_too)
{
	static const struct {
		enum incise_actuator_mode mode;
		bool invert;
		double within_mm;
	} cases[] = {
		/* Exactly: an integrator leaves no error. */
		{CSV, false, 2e-4},
		{CSV, true, 2e-4},
		/* The deflection of a spring of stiffness_permille_mm at half a ‰. */
		{CST, false, 0.02},
		{CST, true, 0.02},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_stepper_status s;

		start(cases[i].mode, 0.1);
		rig.actuator.invert = cases[i].invert;
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

/* Another program gives it power. */
TEST(power_that_nobody_gave_is_a_fault)
{
	start(CSP, 0.1);
	can_rig_open_or_fail(&rig);
	drive_enter(&rig.drive, CIA402_ENABLED);
	can_rig_advance(&rig, 1000 * MS);
	assert_int_equal(can_rig_look(&rig).state, INCISE_STEPPER_STATE_FAULT);
	/* And its watch ends that. */
	assert_false(drive_powered(&rig.drive));
	succeeds(!incise_stepper_clear(rig.stepper, &err));
	rig.drive.tripped = false;
	succeeds(!incise_stepper_enable(rig.stepper, &err));
	can_rig_close(&rig);
}

/* The shortest accepted deadman: it must not expire at rest. */
TEST(the_shortest_deadman_holds_at_rest)
{
	can_rig_init(&rig);
	rig.actuator.deadman_s = 0.02;
	assert_non_null(can_rig_open(&rig, &err));
	for (int i = 0; i < 3; i++) {
		can_rig_advance(&rig, 2000 * MS);
		rig.drive.tripped = false;
		succeeds(!incise_stepper_enable(rig.stepper, &err));
		assert_int_equal(incise_stepper_disable(rig.stepper, NULL), 0);
	}
	assert_int_equal(rig.drive.quick_stops, 0);
	can_rig_close(&rig);
}

/* Its brake opens while it gets power. */
TEST(one_that_gives_way_gets_no_jump)
{
	static const double way_mm[] = {-0.3, -2, 0.005};

	for (size_t i = 0; i < sizeof(way_mm) / sizeof(*way_mm); i++) {
		can_rig_init(&rig);
		rig.drive.enable_ns = 50 * MS;
		assert_non_null(can_rig_open(&rig, &err));
		rig.drive.gives_way = way_mm[i] * COUNTS_PER_MM;
		assert_int_equal(incise_stepper_enable(rig.stepper, &err),
				 way_mm[i] < 0 ? -ERANGE : 0);
		assert_true(rig.drive.gives_way == 0);
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

TEST(it_homes_by_itself)
{
	static const double home_mm[] = {0, -0.5, 1.5};

	for (size_t i = 0; i < sizeof(home_mm) / sizeof(*home_mm); i++) {
		struct incise_stepper_edge_found edge = {0, 0};
		struct incise_stepper_status s;

		can_rig_init(&rig);
		rig.actuator.home_mm = home_mm[i];
		can_rig_open_or_fail(&rig);
		assert_false(can_rig_look(&rig).homed);
		can_rig_enable_or_fail(&rig);
		succeeds(!incise_stepper_home(rig.stepper, NULL, &edge, &err));
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

/*
 * Drives that begin late, keep the bits of their last homing, never report to be there, do not set
 * their count, or set one of their own: homed is only one whose shaft is where its count says, for
 * the next program too, and a good drive always is.
 */
TEST(homed_only_where_the_shaft_is)
{
	const int n = cases_of(1000, 50);
	uint64_t key = cases_seed(7), drawn = 0;
	int good = 0, refused = 0;

	for (int i = 0; i < n; i++) {
		bool late = (incise_random_bits(key, drawn++) % (2)),
		     before = (incise_random_bits(key, drawn++) % (2));
		/* Units that do not fit: from a hundredth of the speed to hundred times. */
		double factor = pow(
			10, (double)(incise_random_bits(key, drawn++) % 401) / 100 - 2);
		int fault = (int)(incise_random_bits(key, drawn++) % (7));
		double tolerance =
			1.1 * COUNTS_PER_MM; /* following_mm, and its braking */
		int rc;

		can_rig_init(&rig);
		/* Far enough for its speed to be seen, up to its 607F. */
		rig.drive.origin = fault == 6 && factor > 1 ? 80000 : 20000;
		rig.drive.speed_factor = fault == 6 ? factor : 1;
		/* Its bits are not seen without power: it is homed in each session. */
		rig.drive.mode_late = !(incise_random_bits(key, drawn++) % 8);
		can_rig_open_or_fail(&rig);
		can_rig_enable_or_fail(&rig);
		if (before && fault != 6) {
			rig.drive.homing_fails = (incise_random_bits(key, drawn++) % (2));
			rc = incise_stepper_home(rig.stepper, NULL, NULL, &err);
			assert_int_equal(!rc, !rig.drive.homing_fails);
			if (rc)
				assert_int_equal(incise_stepper_clear(rig.stepper, &err),
						 0);
			can_rig_enable_or_fail(&rig);
		}
		rig.drive.homing_late_ns =
			late ? (int64_t)(incise_random_bits(key, drawn++) % 500000000)
			     : 0;
		rig.drive.homing_fails = fault == 1;
		rig.drive.homing_keeps = fault == 2;
		rig.drive.homing_no_count = fault == 3;
		rig.drive.homing_no_reached = fault == 5;
		if (fault == 4)
			rig.drive.homing_own =
				(late ? 2.0 : -2.0) * COUNTS_PER_MM *
				(double)(1 + incise_random_bits(key, drawn++) % 20);
		rc = incise_stepper_home(rig.stepper, NULL, NULL, &err);
		if (!rc) {
			assert_true(can_rig_look(&rig).homed);
			assert_true(fabs(rig.drive.origin + 5000) < tolerance);
			good++;
		} else {
			assert_false(can_rig_look(&rig).homed);
			assert_true(*err.text);
			if (fault < 1)
				fail_msg("case %d: %s", i, err.text);
			refused++;
		}
		if (fault == 1 || fault == 4 || fault == 5)
			assert_true(rc);
		if (fault == 5)
			assert_non_null(strstr(err.text, "bit 10"));
		/* The slow ones also end by their time; between the bounds nothing is seen. */
		if (fault == 6 && (factor > 2.2 || factor < 0.045))
			assert_true(rc);
		if (fault == 6 && factor < 1.8 && factor > 0.055)
			assert_int_equal(rc, 0);
		can_rig_close(&rig);
		/* The drive says the same to the next program, but not to one of another rig.conf. */
		can_rig_open_or_fail(&rig);
		if (can_rig_look(&rig).homed != (!rc && !rig.drive.mode_late))
			fail_msg(
				"case %d: fault %d, late %d, before %d: %d, then homed %d",
				i, fault, late, before, rc, !!rc);
		can_rig_close(&rig);
		rig.actuator.home_mm = 0.5;
		can_rig_open_or_fail(&rig);
		assert_false(can_rig_look(&rig).homed);
		can_rig_close(&rig);
	}
	assert_true(good > n / 5 && refused > n / 5);
}

/* TPDO1 that is silent for a while on the way: at rest is only where it stands. */
TEST(at_rest_only_with_a_position_from_there)
{
	const int n = cases_of(1000, 50);
	uint64_t key = cases_seed(8), drawn = 0;

	can_rig_init(&rig);
	can_rig_open_or_fail(&rig);
	can_rig_enable_or_fail(&rig);
	for (int i = 0; i < n; i++) {
		double to_mm = (double)(incise_random_bits(key, drawn++) % 200) / 20;
		int from_ms = (int)(incise_random_bits(key, drawn++) % 300);
		int silent_ms = (int)(incise_random_bits(key, drawn++) % 130);

		for (int ms = 0; ms < 1500; ms += 5) {
			struct incise_stepper_status s;

			rig.drive.no_tpdo = ms >= from_ms && ms < from_ms + silent_ms;
			can_rig_hold(&rig, to_mm, 5 * MS);
			s = can_rig_look(&rig);
			assert_int_equal(s.faults, 0);
			if (s.state == INCISE_STEPPER_STATE_READY &&
			    fabs(s.position_mm - at_mm()) > 1e-3)
				fail_msg("case %d, %d ms: %g mm, and it is at %g mm", i,
					 ms, s.position_mm, at_mm());
		}
		assert_int_equal(can_rig_look(&rig).state, INCISE_STEPPER_STATE_READY);
	}
	can_rig_close(&rig);
}

/* Its mode is what it is in when it is enabled, or it does not move. */
TEST(a_mode_that_is_not_taken_is_not_used)
{
	can_rig_init(&rig);
	rig.drive.mode_late = true;
	can_rig_open_or_fail(&rig);
	can_rig_enable_or_fail(&rig);
	can_rig_hold(&rig, 5, 2000 * MS);
	assert_true(fabs(at_mm() - 5) < 1e-3);
	assert_int_equal(incise_stepper_disable(rig.stepper, NULL), 0);
	rig.drive.mode_never = true;
	assert_int_equal(incise_stepper_enable(rig.stepper, &err), -ETIMEDOUT);
	assert_non_null(strstr(err.text, "none (0)"));
	assert_false(drive_powered(&rig.drive));
	can_rig_close(&rig);
}

/* Without 607D nothing tells the next program; this one need not be told. */
TEST(a_drive_without_a_range_is_homed_in_each_session)
{
	can_rig_init(&rig);
	drive_lacks(&rig.drive, 0x607d, -1);
	can_rig_open_or_fail(&rig);
	can_rig_enable_or_fail(&rig);
	succeeds(!incise_stepper_home(rig.stepper, NULL, NULL, &err));
	assert_true(can_rig_look(&rig).homed);
	emcy(&rig.drive, true);
	can_rig_hold(&rig, 0, 500 * MS);
	assert_false(can_rig_look(&rig).homed);
	succeeds(!incise_stepper_clear(rig.stepper, &err));
	assert_true(can_rig_look(&rig).homed);
	can_rig_close(&rig);
	can_rig_open_or_fail(&rig);
	assert_false(can_rig_look(&rig).homed);
	can_rig_close(&rig);
}

TEST(homing_can_fail_and_be_stopped)
{
	volatile int stop = 0;

	can_rig_init(&rig);
	can_rig_open_or_fail(&rig);
	assert_int_equal(incise_stepper_home(rig.stepper, NULL, NULL, &err), -EIO);
	assert_true(*err.text);
	can_rig_enable_or_fail(&rig);
	rig.drive.homing_fails = true;
	assert_int_equal(incise_stepper_home(rig.stepper, NULL, NULL, &err), -EIO);
	assert_non_null(strstr(err.text, "homing"));
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
