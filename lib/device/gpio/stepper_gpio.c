// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A stepper on GPIO lines, for machines that cannot load the module: "gpio:CHIP", with the
 * lines in actuator.lines of rig.conf. A thread makes the steps, real-time if permitted.
 *
 *   incise_stepper_…() ─▶ pages, mailbox ─▶ thread: pulser ─▶ libgpiod
 *
 * The thread sleeps until shortly before an edge is due, and polls the clock for the rest: that
 * absorbs late wake-ups.
 */
#include <errno.h>
#include <limits.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <incise/clock.h>
#include "../../base/monotonic.h"
#include "../../rig/backends.h"
#include "../../rig/motor.h"
#include "pulser.h"
#include "../../rig/thread.h"
#include "gpio_lines.h"

#define SLEEPS 64 /* of the self-test */
#define SLEEP_NS 200000
#define SPIN_MAX_NS 200000
#define WRITES 64
#define RATE_MOST 20000 /* steps/s, whatever the self-test finds */
#define ANSWER_NS INCISE_NS_PER_S

enum command { NONE, ENABLE, DISABLE, CLEAR, ORIGIN, HOMED, END };

struct gpio_stepper {
	struct incise_motor motor;
	/* The two pages. */
	_Alignas(64) struct incise_stepper_setpoint setpoint;
	_Alignas(64) struct incise_stepper_motor_status status;
	/* Mailbox: written by the caller while it is NONE, else by the thread. */
	_Alignas(64) atomic_int command;
	int32_t steps;
	int answer;
	/* The thread's. */
	_Alignas(64) struct incise_pulser pulser;
	struct gpio_lines *lines;
	unsigned int active_low;
	int64_t spin_ns;
	pthread_t thread;
	bool runs;
};

/* --- the pulser's clock and lines --- */

static int64_t world_now(void *world)
{
	(void)world;
	return incise_monotonic_ns();
}

static int world_write(void *world, enum incise_pulser_output output, bool active)
{
	static const enum incise_actuator_line line[] = {
		[INCISE_PULSER_STEP] = INCISE_LINE_STEP,
		[INCISE_PULSER_DIR] = INCISE_LINE_DIR,
		[INCISE_PULSER_ENABLE] = INCISE_LINE_ENABLE,
	};
	struct gpio_stepper *g = world;
	bool low = g->active_low >> line[output] & 1;

	return gpio_lines_write(g->lines, line[output], active != low);
}

static unsigned int input_bits(unsigned int lines)
{
	static const unsigned int bit[INCISE_LINES] = {
		[INCISE_LINE_LIMIT_MIN] = INCISE_STEPPER_LINE_LIMIT_MIN,
		[INCISE_LINE_LIMIT_MAX] = INCISE_STEPPER_LINE_LIMIT_MAX,
		[INCISE_LINE_HOME] = INCISE_STEPPER_LINE_HOME,
		[INCISE_LINE_ESTOP] = INCISE_STEPPER_LINE_ESTOP,
		[INCISE_LINE_ALARM] = INCISE_STEPPER_LINE_ALARM,
	};
	unsigned int bits = 0;

	for (int i = INCISE_LINES_OUT; i < INCISE_LINES; i++)
		if (lines >> i & 1)
			bits |= bit[i];
	return bits;
}

static int world_inputs(void *world)
{
	struct gpio_stepper *g = world;
	int high = gpio_lines_read(g->lines);

	/* A line that is not wired is neither in active_low nor high. */
	return high < 0 ? high : (int)input_bits((unsigned int)high ^ g->active_low);
}

static const struct incise_pulser_ops world_ops = {world_now, world_write, world_inputs};

/* --- the thread --- */

static int obey(struct gpio_stepper *g, int command)
{
	switch (command) {
	case ENABLE:
		return incise_pulser_enable(&g->pulser);
	case DISABLE:
		incise_pulser_disable(&g->pulser);
		return 0;
	case CLEAR:
		return incise_pulser_clear(&g->pulser);
	case ORIGIN:
	case HOMED:
		return incise_pulser_origin(&g->pulser, g->steps, command == HOMED);
	default:
		return 0;
	}
}

static void *thread_run(void *argument)
{
	struct gpio_stepper *g = argument;
	int command = NONE;

	while (command != END) {
		int64_t due = incise_pulser_run(&g->pulser);
		int64_t spin_ns = g->pulser.motion.resting ? 0 : g->spin_ns;

		command = atomic_load_explicit(&g->command, memory_order_acquire);
		if (command != NONE) {
			g->answer = obey(g, command);
			atomic_store_explicit(&g->command, NONE, memory_order_release);
			continue;
		}
		if (due - incise_monotonic_ns() > spin_ns)
			incise_monotonic_sleep_until(due - spin_ns);
	}
	return NULL;
}

/* --- functions of the motor --- */

static struct gpio_stepper *stepper_gpio_of(struct incise_motor *motor)
{
	return (struct gpio_stepper *)motor;
}

static int post(struct gpio_stepper *g, enum command command)
{
	int64_t end = incise_monotonic_ns() + ANSWER_NS;

	atomic_store_explicit(&g->command, command, memory_order_release);
	while (atomic_load_explicit(&g->command, memory_order_acquire) != NONE) {
		if (incise_monotonic_ns() > end && command != END)
			return -EIO;
		incise_monotonic_sleep_until(incise_monotonic_ns() + 50000);
	}
	return g->answer;
}

static int gpio_enable(struct incise_motor *motor, struct incise_error *err)
{
	(void)err;
	return post(stepper_gpio_of(motor), ENABLE);
}

static int gpio_disable(struct incise_motor *motor)
{
	return post(stepper_gpio_of(motor), DISABLE);
}

static int gpio_clear(struct incise_motor *motor, struct incise_error *err)
{
	(void)err;
	return post(stepper_gpio_of(motor), CLEAR);
}

static int gpio_origin(struct incise_motor *motor, int32_t steps, bool homed)
{
	stepper_gpio_of(motor)->steps = steps;
	return post(stepper_gpio_of(motor), homed ? HOMED : ORIGIN);
}

static INCISE_REALTIME int64_t gpio_now(struct incise_motor *motor)
{
	(void)motor;
	return incise_monotonic_ns();
}

static void gpio_close(struct incise_motor *motor)
{
	struct gpio_stepper *g = stepper_gpio_of(motor);

	if (g->runs) {
		motor->stepper.ops->disable(&motor->stepper, NULL);
		post(g, END);
		pthread_join(g->thread, NULL);
	}
	if (g->lines) {
		world_write(g, INCISE_PULSER_STEP, false);
		world_write(g, INCISE_PULSER_ENABLE, false);
		gpio_lines_close(g->lines);
	}
	free(g);
}

static int ascending(const void *a, const void *b)
{
	int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;

	return (x > y) - (x < y);
}

/* Measure the rate that this machine can keep, without moving the motor. */
static int self_test(struct gpio_stepper *g, uint32_t *rate_max, uint32_t *pulse_ns)
{
	int64_t late[SLEEPS], write[WRITES], step_ns;

	for (int i = 0; i < SLEEPS; i++) {
		int64_t due = incise_monotonic_ns() + SLEEP_NS;

		incise_monotonic_sleep_until(due);
		late[i] = incise_monotonic_ns() - due;
	}
	for (int i = 0; i < WRITES; i++) {
		int64_t begin = incise_monotonic_ns();
		int rc = world_write(g, INCISE_PULSER_STEP, false);

		if (rc < 0 || (rc = world_inputs(g)) < 0)
			return rc;
		write[i] = incise_monotonic_ns() - begin;
	}
	qsort(late, SLEEPS, sizeof(*late), ascending);
	qsort(write, WRITES, sizeof(*write), ascending);
	g->spin_ns = late[SLEEPS - 1] < SPIN_MAX_NS ? late[SLEEPS - 1] : SPIN_MAX_NS;
	/* A step is two edges, each with a read of the inputs; half of the time is spare. */
	step_ns = 2 * (2 * write[WRITES * 9 / 10] + late[SLEEPS * 9 / 10]);
	*pulse_ns = (uint32_t)write[WRITES * 9 / 10];
	*rate_max = step_ns > INCISE_NS_PER_S / RATE_MOST
			    ? (uint32_t)(INCISE_NS_PER_S / step_ns)
			    : RATE_MOST;
	return *rate_max ? 0 : -ERANGE;
}

static int start_stepper_gpio_thread(struct gpio_stepper *g)
{
	size_t length = strlen(g->motor.name);
	bool real_time;
	int rc = incise_thread_start(&g->thread, thread_run, g, &real_time);

	if (rc)
		return rc;
	g->runs = true;
	if (!real_time)
		snprintf(g->motor.name + length, sizeof(g->motor.name) - length,
			 ", not real-time");
	return 0;
}

static int request_lines(struct gpio_stepper *g,
			 const struct incise_backend_request *request,
			 struct incise_error *err)
{
	const struct incise_actuator *actuator = request->actuator;
	const char *todo;
	char path[GPIO_PATH_MAX], several[GPIO_SEVERAL_MAX];
	int rc;

	if (!*request->arguments)
		return incise_error_set(
			err, EINVAL,
			"%s: expected gpio:CHIP, a name, label or path, for example "
			"gpio:gpiochip0; correct it",
			request->where);
	if (!actuator->has_lines)
		return incise_error_set(
			err, EINVAL,
			"%s: gpio needs actuator.lines; add lines = { step "
			"= 17; dir = 27; enable = 22; }; with your lines",
			request->where);
	if (request->watch)
		return incise_error_set(err, EOPNOTSUPP,
					"%s: the program that drives a gpio stepper "
					"makes its steps, so another program cannot "
					"watch it; use that program",
					request->where);
	/* At rest all are inactive. */
	rc = gpio_chip_find(request->arguments, path, several);
	errno = -rc;
	g->lines =
		rc ? NULL : gpio_lines_open(path, actuator->line, actuator->active_low);
	if (g->lines)
		return 0;
	switch (errno) {
	case ENOENT:
	case ENODEV:
		todo = "no such chip; `gpiodetect` lists them";
		break;
	case ENOTUNIQ:
		return incise_error_set(
			err, ENOTUNIQ,
			"%s: gpio chip %.60s: several have this name: %s; give "
			"the path of yours, see `gpiodetect`",
			request->where, request->arguments, several);
	case EBUSY:
		todo = "a line is in use; `gpioinfo` prints its user";
		break;
	case EACCES:
	case EPERM:
		todo = "not permitted; become a member of the group that owns "
		       "/dev/gpiochip*, or root";
		break;
	case EINVAL:
		todo = "it lacks a line of actuator.lines; correct the offsets";
		break;
	default:
		todo = strerror(errno);
	}
	return incise_error_set(err, errno, "%s: gpio chip %.60s: %s", request->where,
				request->arguments, todo);
}

static int set_up_stepper_gpio(struct gpio_stepper *g,
			       const struct incise_backend_request *request,
			       struct incise_error *err)
{
	struct incise_stepper_config config;
	uint32_t rate_max, pulse_ns;
	int rc = request_lines(g, request, err);

	if (rc)
		return rc;
	rc = self_test(g, &rate_max, &pulse_ns);
	if (rc)
		return incise_error_set(
			err, -rc, "%s: gpio chip %.60s: its lines cannot be used: %s",
			request->where, request->arguments, strerror(-rc));
	rc = incise_motor_fit(&g->motor.actuator, request->where, rate_max, pulse_ns,
			      2 * pulse_ns, err);
	if (rc)
		return rc;
	g->motor.rate_max_hz = rate_max;
	incise_motor_config(&g->motor.actuator, 0, &config);
	/* No page fault in a step; mlock() may be refused. */
	mlock(g, sizeof(*g));
	rc = incise_pulser_init(&g->pulser, &config);
	if (!rc)
		rc = start_stepper_gpio_thread(g);
	return rc ? incise_error_set(err, -rc, "%s: cannot begin: %s", g->motor.name,
				     strerror(-rc))
		  : 0;
}

static void *gpio_open(const struct incise_backend_request *request,
		       struct incise_error *err)
{
	static const struct incise_motor_ops ops = {
		.enable = gpio_enable,
		.disable = gpio_disable,
		.clear = gpio_clear,
		.origin = gpio_origin,
		.close = gpio_close,
		.now = gpio_now,
	};
	struct gpio_stepper *g = incise_device_new(sizeof(*g), request->where, err);
	int rc;

	if (!g)
		return NULL;
	g->motor.ops = &ops;
	g->motor.in_process = true;
	g->motor.actuator = *request->actuator;
	g->motor.setpoint = &g->setpoint;
	g->motor.slot = &g->status;
	g->active_low = request->actuator->active_low;
	for (int i = 0; i < INCISE_LINES; i++)
		if (request->actuator->line[i] >= 0)
			g->motor.lines |= input_bits(1u << i);
	snprintf(g->motor.name, sizeof(g->motor.name), "gpio chip %.24s",
		 request->arguments);
	incise_motor_init(&g->motor);
	g->pulser.home = incise_motor_home_line(&g->motor);
	g->pulser.ops = &world_ops;
	g->pulser.world = g;
	g->pulser.motion.setpoint = &g->setpoint;
	g->pulser.motion.slot = &g->status;
	rc = set_up_stepper_gpio(g, request, err);
	if (!rc)
		return &g->motor.stepper;
	gpio_close(&g->motor);
	errno = -rc;
	return NULL;
}

INCISE_BACKEND(incise_stepper_gpio, "stepper", "gpio", .open = gpio_open);
