// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/gpio/stepper_gpio.c with its thread, on lines that a test makes in the place
 * of libgpiod's: polarity, what is said when it cannot begin, and that it ends as it
 * should. No time is judged here: pulses of 1 ms let any machine keep up. Times are those
 * of the pulser's tests and of tests/vm.
 */
#include "../unit.h"
#include <stdatomic.h>
#include <time.h>
#include "../../../lib/rig/backends.h"
#include "../../../lib/device/gpio/gpio_lines.h"

extern const struct incise_backend incise_stepper_gpio;

/* A chip; levels, not what they mean. */
struct gpio_lines {
	int line[INCISE_LINES];
};

static struct {
	atomic_uint level; /* bits 1 << line */
	atomic_int steps;  /* rising edges of the line, not of what it means */
	atomic_int error;
	int open_error, open;
	unsigned int idle;
	char chip[64];
} chip;

int gpio_chip_find(const char *name, char path[GPIO_PATH_MAX],
		   char several[GPIO_SEVERAL_MAX])
{
	snprintf(path, GPIO_PATH_MAX, "%s", name);
	strcpy(several, "/dev/gpiochip0, /dev/gpiochip1");
	return chip.open_error == ENOTUNIQ ? -ENOTUNIQ : 0;
}

struct gpio_lines *gpio_lines_open(const char *name, const int *line, unsigned int idle)
{
	struct gpio_lines *lines = calloc(1, sizeof(*lines));

	errno = chip.open_error;
	if (chip.open_error || !lines) {
		free(lines);
		return NULL;
	}
	memcpy(lines->line, line, sizeof(lines->line));
	strncpy(chip.chip, name, sizeof(chip.chip) - 1);
	chip.idle = idle;
	atomic_fetch_or(&chip.level, idle & ((1u << INCISE_LINES_OUT) - 1));
	chip.open++;
	return lines;
}

int gpio_lines_write(struct gpio_lines *lines, enum incise_actuator_line line, bool high)
{
	unsigned int bit = 1u << line, before;

	if (atomic_load(&chip.error))
		return atomic_load(&chip.error);
	if (lines->line[line] < 0)
		return 0;
	before = high ? atomic_fetch_or(&chip.level, bit)
		      : atomic_fetch_and(&chip.level, ~bit);
	if (line == INCISE_LINE_STEP && high && !(before & bit))
		atomic_fetch_add(&chip.steps, 1);
	return 0;
}

int gpio_lines_read(struct gpio_lines *lines)
{
	int bits = 0;

	for (int i = INCISE_LINES_OUT; i < INCISE_LINES; i++)
		if (lines->line[i] >= 0)
			bits |= (int)(atomic_load(&chip.level) & 1u << i);
	return bits;
}

void gpio_lines_close(struct gpio_lines *lines)
{
	chip.open--;
	free(lines);
}

/* 250 steps/s of 0.01 mm. */
static struct incise_actuator slow(void)
{
	return (struct incise_actuator){
		.spring_N_mm = 2,
		.travel_mm = 5,
		.lead_mm = 2,
		.steps_per_turn = 200,
		.microsteps = 1,
		.velocity_mm_s = 2.5,
		.acceleration_mm_s2 = 1000,
		.deadman_s = 3600, /* more than a busy machine stands still */
		.tick_ns = 2000000,
		.high_ns = 1000000,
		.low_ns = 1000000,
		.home_mm_s = 1,
		.has_lines = true,
		.line = {17, 27, 22, -1, -1, -1, 6, -1},
		.active_low = 1 << INCISE_LINE_ENABLE | 1 << INCISE_LINE_ESTOP,
	};
}

/*
 * While a stepper is opened no sleep ends late: its self-test would find that a busy machine cannot
 * keep up with even a slow motor. The thread that drives it has the clock as it is.
 */
static __thread bool punctual;
static __thread struct timespec woken; /* what the clock says next; 0: the time */

int __real_clock_gettime(clockid_t id, struct timespec *t);
int __real_clock_nanosleep(clockid_t id, int flags, const struct timespec *until,
			   struct timespec *rest);

int __wrap_clock_nanosleep(clockid_t id, int flags, const struct timespec *until,
			   struct timespec *rest)
{
	int rc = __real_clock_nanosleep(id, flags, until, rest);

	if (punctual && !rc)
		woken = *until;
	return rc;
}

int __wrap_clock_gettime(clockid_t id, struct timespec *t)
{
	if (!woken.tv_sec)
		return __real_clock_gettime(id, t);
	*t = woken;
	woken = (struct timespec){0};
	return 0;
}

static struct incise_stepper *open_stepper(const char *arguments, bool watch,
					   const struct incise_actuator *actuator,
					   struct incise_error *err)
{
	struct incise_backend_request request = {
		.arguments = arguments,
		.where = "rig.conf:1: stepper",
		.watch = watch,
		.actuator = actuator,
	};

	struct incise_stepper *stepper;
	int code;

	punctual = true;
	stepper = incise_stepper_gpio.open(&request, err);
	code = errno;
	punctual = false;
	woken = (struct timespec){0};
	errno = code;
	return stepper;
}

#define NAPS 30000 /* end a test that hangs: a minute */

static void nap(void)
{
	nanosleep(&(struct timespec){.tv_nsec = 2000000}, NULL);
}

/*
 * Until a state comes, past a place; a machine that is busy may take its time, and never see a
 * state between.
 */
static struct incise_stepper_status await(struct incise_stepper *stepper,
					  enum incise_stepper_state state, double past_mm)
{
	struct incise_stepper_status status = {0};

	for (int i = 0; i < NAPS; i++) {
		assert_int_equal(incise_stepper_status(stepper, &status), 0);
		if (status.state == state && status.position_mm >= past_mm)
			return status;
		nap();
	}
	fail_msg("%s never came; it is %s, faults %#x", incise_stepper_state_name(state),
		 incise_stepper_state_name(status.state), status.faults);
	return status;
}

TEST(it_steps_and_lets_go)
{
	struct incise_actuator actuator = slow();
	struct incise_stepper_status status;
	struct incise_stepper_info info;
	struct incise_stepper *stepper;

	memset(&chip, 0, sizeof(chip));
	/* The e-stop rests high: released. */
	atomic_store(&chip.level, 1u << INCISE_LINE_ESTOP);
	stepper = open_stepper("pinctrl", false, &actuator, &err);
	succeeds(stepper);
	assert_string_equal(chip.chip, "pinctrl");
	assert_int_equal(chip.idle, actuator.active_low);
	incise_stepper_info(stepper, &info);
	assert_int_equal(strncmp(info.name, "gpio chip pinctrl", 17), 0);
	assert_int_equal(info.inputs, INCISE_STEPPER_LINE_ESTOP);
	assert_true(info.rate_max_hz > 0 && info.step_mm == 0.01);
	assert_true(atomic_load(&chip.level) >> INCISE_LINE_ENABLE & 1);
	assert_int_equal(incise_stepper_enable(stepper, &err), 0);
	assert_false(atomic_load(&chip.level) >> INCISE_LINE_ENABLE & 1);
	assert_int_equal(incise_stepper_set(stepper, 0.1), 0);
	status = await(stepper, INCISE_STEPPER_STATE_READY, 0.0999);
	assert_true(status.position_mm > 0.0999 && status.position_mm < 0.1001);
	assert_int_equal(atomic_load(&chip.steps), 10);
	assert_true(atomic_load(&chip.level) >> INCISE_LINE_DIR & 1);
	/* Pressed: low. */
	atomic_fetch_and(&chip.level, ~(1u << INCISE_LINE_ESTOP));
	status = await(stepper, INCISE_STEPPER_STATE_FAULT, 0);
	assert_int_equal(status.faults, INCISE_STEPPER_FAULT_ESTOP);
	assert_true(atomic_load(&chip.level) >> INCISE_LINE_ENABLE & 1);
	assert_error(incise_stepper_clear(stepper, &err), EBUSY, &err, "e-stop");
	assert_error(incise_stepper_enable(stepper, &err), EPERM, &err, "e-stop");
	atomic_fetch_or(&chip.level, 1u << INCISE_LINE_ESTOP);
	assert_int_equal(incise_stepper_clear(stepper, &err), 0);
	assert_int_equal(incise_stepper_enable(stepper, &err), 0);
	/* Closed under way: 2 s of it, from a step on that a slow thread cannot miss. */
	assert_int_equal(incise_stepper_set(stepper, 5), 0);
	for (int i = 0; atomic_load(&chip.steps) == 10; i++) {
		assert_true(i < NAPS);
		nap();
	}
	stepper->ops->close(stepper);
	assert_int_equal(chip.open, 0);
	assert_true(atomic_load(&chip.level) >> INCISE_LINE_ENABLE & 1);
	assert_false(atomic_load(&chip.level) >> INCISE_LINE_STEP & 1);
}

TEST(why_it_cannot_begin_is_said)
{
	static const struct {
		const char *arguments;
		bool watch, no_lines;
		int open_error, line_error;
		double velocity_mm_s;
		int code;
		const char *says;
	} cases[] = {
		{"", false, false, 0, 0, 2.5, EINVAL, "gpio:CHIP"},
		{"c", false, true, 0, 0, 2.5, EINVAL, "actuator.lines"},
		{"c", true, false, 0, 0, 2.5, EOPNOTSUPP, "watch"},
		{"c", false, false, ENOENT, 0, 2.5, ENOENT, "gpiodetect"},
		{"c", false, false, EBUSY, 0, 2.5, EBUSY, "gpioinfo"},
		{"c", false, false, EACCES, 0, 2.5, EACCES, NULL},
		{"c", false, false, ENOTUNIQ, 0, 2.5, ENOTUNIQ,
		 "/dev/gpiochip0, /dev/gpiochip1"},
		{"c", false, false, EINVAL, 0, 2.5, EINVAL, "line"},
		{"c", false, false, 0, -EREMOTEIO, 2.5, EREMOTEIO, NULL},
		/* 30 000 steps/s: more than it ever says that it holds. */
		{"c", false, false, 0, 0, 300, ERANGE, "30000 steps/s"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_actuator actuator = slow();

		memset(&chip, 0, sizeof(chip));
		chip.open_error = cases[i].open_error;
		atomic_store(&chip.error, cases[i].line_error);
		actuator.has_lines = !cases[i].no_lines;
		actuator.velocity_mm_s = cases[i].velocity_mm_s;
		actuator.high_ns = actuator.low_ns = 5000;
		assert_error(open_stepper(cases[i].arguments, cases[i].watch, &actuator,
					  &err),
			     cases[i].code, &err, cases[i].says);
		assert_int_equal(chip.open, 0);
	}
}
