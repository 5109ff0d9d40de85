// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Inputs of the stepper module that are seen twice, late, never, or cannot be read. The
 * simulated chip holds its interrupts, so that a tick sees an edge before its interrupt
 * does: every time, not now and then.
 */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "../bench.h"
#include "../tap.h"

#define TICK_NS 1000000
#define PRESSES 100
#define HOME bench_line(0, BENCH_HOME)
#define LONG 60000000000 /* ns: never, on any host */

static struct bench bench;

static struct incise_stepper_config config_of(unsigned int motor)
{
	return (struct incise_stepper_config){
		.motor = motor,
		.tick_ns = TICK_NS,
		.velocity = bench.info.rate_max < 2000 ? bench.info.rate_max : 2000,
		.acceleration = 100000,
		.late_max = 1000,
		.position_min = -100000,
		.position_max = 100000,
		.deadman_ns = 10000000000,
		.high_ns = bench.info.pulse_ns,
		.low_ns = bench.info.pulse_ns,
	};
}

static bool starts(unsigned int n_motors)
{
	struct incise_stepper_config config;
	int ret;

	ret = bench_bind(&bench, n_motors);
	ret = ret ? ret : bench_open(&bench);
	for (unsigned int i = 0; i < n_motors && !ret; i++) {
		config = config_of(i);
		ret = bench_configure(&bench, &config, 0);
	}
	return check(!ret, "%u motors are bound (%s)", n_motors, strerror(-ret));
}

static void ends(void)
{
	simulator_write("faults", "none");
	bench_close(&bench);
	check(!bench_unbind(&bench), "they are unbound");
}

/* Until the motor's ticks have seen a level of an input. */
static bool seen(uint32_t input, bool active)
{
	int64_t end_ns = bench_now_ns() + LONG;

	while (!(bench_look(&bench, 0).inputs & input) == active) {
		if (bench_now_ns() > end_ns)
			return false;
		bench_nap(TICK_NS);
	}
	return true;
}

/* Drains the events; returns how many of them are changes of inputs. */
static int changes(void)
{
	struct incise_stepper_event event[64];
	int n = 0;
	ssize_t got;

	while ((got = read(bench.fd, event, sizeof(event))) > 0)
		for (ssize_t i = 0; i < got / (ssize_t)sizeof(*event); i++)
			n += event[i].type == INCISE_STEPPER_EVENT_INPUT;
	return n;
}

static bool goes_to(int64_t target)
{
	int64_t end_ns = bench_now_ns() + LONG;

	do {
		bench_until(&bench, 0, 1U << INCISE_STEPPER_STATE_READY,
			    INCISE_STEPPER_MODE_POSITION, target, LONG);
		if (bench_now_ns() > end_ns)
			return false;
	} while (bench_look(&bench, 0).position != target);
	return true;
}

/* A press of home begins at one place and ends 5 steps on. */
static void home_is_pressed(void)
{
	int phantoms = 0, moved = 0, presses = 0;

	check(!bench_command(&bench, INCISE_STEPPER_ENABLE, 1), "power");
	changes();
	for (int i = 0; i < PRESSES; i++) {
		int64_t at = 10 * i;
		int n;

		if (!goes_to(at))
			break;
		simulator_write("inputs", "%u 1", HOME);
		if (!seen(INCISE_STEPPER_LINE_HOME, true) || !goes_to(at + 5))
			break;
		/* The next tick sees the edge first, the interrupt comes when it is over. */
		simulator_write("faults", "interrupts=held");
		simulator_write("inputs", "%u 0", HOME);
		if (!seen(INCISE_STEPPER_LINE_HOME, false))
			break;
		simulator_write("faults", "interrupts=come");
		n = changes();
		phantoms += n > 2;
		moved += bench_look(&bench, 0).home_position != at;
		presses++;
	}
	check(presses == PRESSES, "home is pressed %d times", presses);
	check(!phantoms, "each press is one press (%d are two)", phantoms);
	check(!moved, "home_position is that of the leading edge (%d are not)", moved);
	bench_command(&bench, INCISE_STEPPER_DISABLE, 1);
	bench_until(&bench, 0, 1U << INCISE_STEPPER_STATE_DISABLED,
		    INCISE_STEPPER_MODE_POSITION, 0, LONG);
}

/* Shorter than the way to its interrupt, and between two ticks: it stops all the same. */
static void short_press_stops(void)
{
	bool stops = true;

	for (int i = 0; i < 10; i++) {
		bench_command(&bench, INCISE_STEPPER_CLEAR, 1);
		stops &= !bench_command(&bench, INCISE_STEPPER_ENABLE, 1);
		simulator_write("faults", "interrupts=held");
		simulator_write("inputs", "%u 0", BENCH_ESTOP);
		simulator_write("inputs", "%u 1", BENCH_ESTOP);
		simulator_write("faults", "interrupts=come");
		stops &= bench_look(&bench, 0).faults == INCISE_STEPPER_FAULT_ESTOP;
	}
	check(stops, "an e-stop that was released again has stopped the motor");
	bench_command(&bench, INCISE_STEPPER_CLEAR, 1);
}

static void unreadable_forbids(void)
{
	simulator_write("faults", "unreadable=%u", BENCH_ESTOP);
	check(bench_command(&bench, INCISE_STEPPER_ENABLE, 1) == -EBUSY,
	      "no power while the e-stop cannot be read");
	bench_command(&bench, INCISE_STEPPER_DISABLE, 1);
	simulator_write("faults", "none");
	bench_command(&bench, INCISE_STEPPER_CLEAR, 1);
	check(!bench_command(&bench, INCISE_STEPPER_ENABLE, 1), "power when it can be");
	simulator_write("faults", "unreadable=%u", bench_line(0, BENCH_MAX));
	check(bench_until(&bench, 0, 1U << INCISE_STEPPER_STATE_FAULT,
			  INCISE_STEPPER_MODE_POSITION, 0, LONG) &&
		      bench_look(&bench, 0).faults == INCISE_STEPPER_FAULT_LINE,
	      "a limit that cannot be read takes power away");
	simulator_write("faults", "none");
	bench_command(&bench, INCISE_STEPPER_CLEAR, 1);
}

/* The fault of motor 2 comes on when motor 1 gets power: motor 0 had it before. */
static void enable_takes_back_its_own(void)
{
	int ret;

	check(!bench_command(&bench, INCISE_STEPPER_ENABLE, 1), "motor 0 has power");
	simulator_write("scripts", "after=1 line=%u set=%u value=1",
			bench_line(1, BENCH_ENABLE), bench_line(2, BENCH_FAULT));
	ret = bench_command(&bench, INCISE_STEPPER_ENABLE, 7);
	check(ret == -EBUSY, "enable of three is refused as the third has a fault (%d)",
	      ret);
	bench_until(&bench, 0, 0, INCISE_STEPPER_MODE_VELOCITY, 0, 20 * TICK_NS);
	check(bench_look(&bench, 0).state == INCISE_STEPPER_STATE_READY,
	      "motor 0, which had power before, keeps it");
	check(bench_look(&bench, 1).state == INCISE_STEPPER_STATE_DISABLED &&
		      bench_look(&bench, 2).state == INCISE_STEPPER_STATE_DISABLED,
	      "the others have none");
	simulator_write("scripts", "clear");
	simulator_write("inputs", "%u 0", bench_line(2, BENCH_FAULT));
}

/* A chip without interrupts is polled, and says so; one that fails is not taken. */
static void interrupts_are_missing(void)
{
	simulator_write("faults", "interrupts=none");
	if (starts(1))
		check(bench.info.polled[0] ==
			      (INCISE_STEPPER_LINE_LIMIT_MIN |
			       INCISE_STEPPER_LINE_LIMIT_MAX | INCISE_STEPPER_LINE_HOME |
			       INCISE_STEPPER_LINE_ESTOP | INCISE_STEPPER_LINE_ALARM),
		      "without interrupts every input is said to be polled");
	ends();
	simulator_write("faults", "interrupts=refused");
	check(bench_bind(&bench, 1) == -ENXIO,
	      "a chip that fails to give an interrupt is not bound");
	bench_unbind(&bench);
	simulator_write("faults", "none");
}

#define DEBOUNCE_NS (100 * TICK_NS) /* the longest */
#define BURSTS 100

/* Returns whether the whole of it was shorter than debounce_ns: a host may pause with the limit pressed. */
static bool bounces(void)
{
	int64_t begin_ns = bench_now_ns();

	for (int i = 0; i < 20; i++) {
		simulator_write("inputs", "%u 1", bench_line(0, BENCH_MAX));
		simulator_write("inputs", "%u 0", bench_line(0, BENCH_MAX));
	}
	return bench_now_ns() - begin_ns < DEBOUNCE_NS;
}

/* A contact that bounces is no limit, one that stays is; the e-stop waits for nothing. */
static void limit_bounces(void)
{
	struct incise_stepper_config config = config_of(0);
	bool moves;

	config.debounce_ns = DEBOUNCE_NS;
	if (!check(!bench_configure(&bench, &config, 0), "a motor has debounce_ns"))
		return;
	do {
		bench_command(&bench, INCISE_STEPPER_CLEAR, 1);
		bench_command(&bench, INCISE_STEPPER_ENABLE, 1);
		bench_until(&bench, 0, 1U << INCISE_STEPPER_STATE_MOVING,
			    INCISE_STEPPER_MODE_POSITION, 100000, LONG);
	} while (!bounces());
	moves = bench_until(&bench, 0, 1U << INCISE_STEPPER_STATE_MOVING,
			    INCISE_STEPPER_MODE_POSITION, 100000, LONG);
	check(moves && !bench_look(&bench, 0).faults, "a limit that bounces is no fault");
	simulator_write("inputs", "%u 1", bench_line(0, BENCH_MAX));
	check(bench_until(&bench, 0, 1U << INCISE_STEPPER_STATE_FAULT,
			  INCISE_STEPPER_MODE_POSITION, 100000, LONG) &&
		      bench_look(&bench, 0).faults == INCISE_STEPPER_FAULT_LIMIT_MAX,
	      "a limit that stays is one");
	simulator_write("inputs", "%u 0", bench_line(0, BENCH_MAX));
	bench_command(&bench, INCISE_STEPPER_CLEAR, 1);
	bench_command(&bench, INCISE_STEPPER_ENABLE, 1);
	simulator_write("inputs", "%u 0", BENCH_ESTOP);
	simulator_write("inputs", "%u 1", BENCH_ESTOP);
	check(bench_until(&bench, 0, 1U << INCISE_STEPPER_STATE_FAULT,
			  INCISE_STEPPER_MODE_POSITION, 0, LONG) &&
		      bench_look(&bench, 0).faults == INCISE_STEPPER_FAULT_ESTOP,
	      "an e-stop is not debounced");
	bench_command(&bench, INCISE_STEPPER_CLEAR, 1);
	config.debounce_ns = 0;
	bench_configure(&bench, &config, 0);
}

static int64_t storms(void)
{
	char text[512] = "", path[160];
	const char *at;
	FILE *file;

	snprintf(path, sizeof(path), "/sys/kernel/debug/incise_stepper/%s/counters",
		 strrchr(bench.cdev, '/') + 1);
	file = fopen(path, "r");
	if (!file || !fgets(text, sizeof(text), file))
		text[0] = '\0';
	if (file)
		fclose(file);
	at = strstr(text, " storms=");
	return at ? strtoll(at + 8, NULL, 10) : -1;
}

/* A line that never rests takes no more than its bound: the motor goes on, and hears it again later. */
static void line_storms(void)
{
	int fd = open(INCISE_SIM_DIR "/inputs", O_WRONLY | O_CLOEXEC);
	char edge[2][16];
	bool heard;

	for (int k = 0; k < 2; k++)
		snprintf(edge[k], sizeof(edge[k]), "%u %d", HOME, !k);
	check(!bench_command(&bench, INCISE_STEPPER_ENABLE, 1), "power in a storm");
	for (int i = 0; i < BURSTS; i++) {
		if (!(i % 10))
			bench_want(&bench, 0, INCISE_STEPPER_MODE_POSITION, 50);
		for (int k = 0; k < 40; k++)
			if (write(fd, edge[k & 1], strlen(edge[k & 1])) < 0)
				break;
	}
	close(fd);
	note("%lld storms", (long long)storms());
	if (!strcmp(getenv("INCISE_VM_PROFILE") ?: "", "deterministic"))
		check(storms() > 0, "a storm is bounded, and counted");
	check(goes_to(100), "the motor moves on");
	/* After the pause a press has an interrupt again. */
	simulator_write("inputs", "%u 0", HOME);
	bench_until(&bench, 0, 0, INCISE_STEPPER_MODE_POSITION, 100, 300 * TICK_NS);
	changes();
	simulator_write("inputs", "%u 1", HOME);
	heard = seen(INCISE_STEPPER_LINE_HOME, true);
	check(heard && changes() == 1, "a press is heard after it");
	simulator_write("inputs", "%u 0", HOME);
	bench_rest(&bench, 1);
}

int main(void)
{
	if (!starts(3))
		return 1;
	check(!bench.info.polled[0], "its inputs have interrupts");
	home_is_pressed();
	short_press_stops();
	unreadable_forbids();
	enable_takes_back_its_own();
	bench_rest(&bench, 3);
	limit_bounces();
	line_storms();
	ends();
	interrupts_are_missing();
	return tap_failures != 0;
}
