// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/kernel/stepper_kernel.c on a kernel that a test makes: the linker hands its system
 * calls to functions here, behind which a pulser and a machine play the module, on a clock
 * that goes when one sleeps. The real module is asked in tests/vm.
 */
#include "../unit.h"
#include <fcntl.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <time.h>
#include "../../../lib/rig/backends.h"
#include "../../../lib/rig/motor.h"
#include "../rig/conformance.h"
#include "../rig/machine.h"

extern const struct incise_backend incise_stepper_kernel;

#define FD 7777
#define MOTOR 2

/* The module, and how it shall misbehave. */
static struct {
	_Alignas(4096) char setpoints[4096], status[4096];
	struct incise_stepper_controller info;
	struct incise_pulser pulser;
	struct incise_stepper_config config;
	struct machine machine;
	int open_error, info_error, config_error, config_busy, map_error;
	int opened, mapped, flags;
	bool configured;
} module;

int __real_open(const char *path, int flags, ...);
int __real_close(int fd);
int __real_ioctl(int fd, unsigned long request, void *argument);
void *__real_mmap(void *at, size_t size, int prot, int flags, int fd, off_t offset);
int __real_munmap(void *at, size_t size);

static void run_for(int64_t ns)
{
	int64_t end = module.machine.now_ns + ns;

	while (module.configured) {
		int64_t due = incise_pulser_run(&module.pulser);

		if (due > end)
			break;
		if (due > module.machine.now_ns)
			module.machine.now_ns = due;
	}
	if (module.machine.now_ns < end)
		module.machine.now_ns = end;
}

static int answer(int code)
{
	errno = code < 0 ? -code : code;
	return code ? -1 : 0;
}

int __wrap_open(const char *path, int flags, ...)
{
	if (strncmp(path, "/dev/incise", 11))
		return __real_open(path, flags, 0600);
	if (module.open_error)
		return answer(module.open_error);
	module.opened++;
	module.flags = flags;
	return FD;
}

int __wrap_close(int fd)
{
	if (fd != FD)
		return __real_close(fd);
	module.opened--;
	return 0;
}

static int configure(const struct incise_stepper_config *config)
{
	if (module.config_busy-- > 0)
		return -EBUSY;
	if (module.config_error)
		return -module.config_error;
	module.config = *config;
	if (config->motor != MOTOR)
		return -EINVAL;
	module.machine.config = &module.config;
	module.pulser.ops = &machine_ops;
	module.pulser.world = &module.machine;
	module.pulser.motion.setpoint =
		(struct incise_stepper_setpoint *)module.setpoints + MOTOR;
	module.pulser.motion.slot =
		(struct incise_stepper_motor_status *)module.status + MOTOR;
	module.configured = true;
	return incise_pulser_init(&module.pulser, &module.config);
}

int __wrap_ioctl(int fd, unsigned long request, void *argument)
{
	const struct incise_stepper_origin *origin = argument;

	if (fd != FD)
		return __real_ioctl(fd, request, argument);
	if (request == INCISE_STEPPER_GET_INFO) {
		memcpy(argument, &module.info, sizeof(module.info));
		return answer(module.info_error);
	}
	switch (request) {
	case INCISE_STEPPER_GET_CONFIG:
		((struct incise_stepper_config *)argument)->deadman_ns = 70000000;
		return 0;
	case INCISE_STEPPER_SET_CONFIG:
		return answer(configure(argument));
	case INCISE_STEPPER_SET_POSITION:
		return answer(incise_pulser_origin(
			&module.pulser, (int32_t)origin->position, origin->homed));
	}
	if (*(const __u32 *)argument != 1u << MOTOR)
		return answer(EINVAL);
	switch (request) {
	case INCISE_STEPPER_ENABLE:
		return answer(incise_pulser_enable(&module.pulser));
	case INCISE_STEPPER_DISABLE:
		incise_pulser_disable(&module.pulser);
		return 0;
	case INCISE_STEPPER_CLEAR:
		return answer(incise_pulser_clear(&module.pulser));
	default:
		return answer(ENOTTY);
	}
}

void *__wrap_mmap(void *at, size_t size, int prot, int flags, int fd, off_t offset)
{
	if (fd != FD)
		return __real_mmap(at, size, prot, flags, fd, offset);
	if (module.map_error) {
		errno = module.map_error;
		return MAP_FAILED;
	}
	module.mapped++;
	assert_int_equal(size, 4096);
	return offset ? module.status : module.setpoints;
}

int __wrap_munmap(void *at, size_t size)
{
	if (at != module.setpoints && at != module.status)
		return __real_munmap(at, size);
	module.mapped--;
	return 0;
}

int __wrap_clock_nanosleep(clockid_t id, int flags, const struct timespec *t,
			   struct timespec *left)
{
	run_for(t->tv_sec * 1000000000LL + t->tv_nsec);
	return 0;
}

int __wrap_nanosleep(const struct timespec *t, struct timespec *left)
{
	run_for(t->tv_sec * 1000000000LL + t->tv_nsec);
	return 0;
}

static void module_load(void)
{
	memset(&module, 0, sizeof(module));
	strcpy(module.info.name, "bench");
	module.info.n_motors = 3;
	module.info.rate_max = 20000;
	module.info.edge_ns = 300;
	module.info.lateness_ns = 2000;
	module.info.pulse_ns = 2300;
	module.info.lines[MOTOR] = INCISE_STEPPER_LINE_ESTOP | INCISE_STEPPER_LINE_HOME |
				   INCISE_STEPPER_LINE_LIMIT_MIN |
				   INCISE_STEPPER_LINE_LIMIT_MAX;
	module.machine = (struct machine){.now_ns = 5000000000,
					  .look_ns = 200,
					  .at = 1500,
					  .end = 100000,
					  .wired_home = true,
					  .wired_limits = true};
}

/* 5 mm of travel, 1.25 µm a step, 8000 steps/s. */
static const struct incise_actuator actuator = {
	.spring_N_mm = 2,
	.travel_mm = 5,
	.lead_mm = 4,
	.steps_per_turn = 200,
	.microsteps = 16,
	.velocity_mm_s = 10,
	.acceleration_mm_s2 = 500,
	.deadman_s = 0.1,
	.tick_ns = 250000,
	.setup_ns = 20000,
	.hold_ns = 10000,
	.home_mm_s = 2,
};

static struct incise_stepper *open_stepper(const char *arguments, bool watch,
					   const struct incise_actuator *asked,
					   struct incise_error *err)
{
	struct incise_backend_request request = {
		.arguments = arguments,
		.where = "rig.conf:1: stepper",
		.watch = watch,
		.actuator = asked,
	};

	return incise_stepper_kernel.open(&request, err);
}

static void failed(const char *text)
{
	fail_msg("%s", text);
}

static void sleep_for(void *world, int64_t ns)
{
	run_for(ns);
}

static void raise(void *world, unsigned int input, bool active)
{
	unsigned int line = input == INCISE_STEPPER_LINE_ESTOP
				    ? INCISE_STEPPER_LINE_ESTOP
				    : INCISE_STEPPER_LINE_LIMIT_MAX;

	if (active)
		module.machine.forced |= line;
	else
		module.machine.forced &= ~line;
}

TEST(every_case)
{
	for (int i = 0; conformance[i].name; i++) {
		struct conformance c = {
			.advance = sleep_for, .input = raise, .say = failed};

		module_load();
		c.stepper =
			open_stepper("/dev/incise-stepper0:2", false, &actuator, &err);
		succeeds(c.stepper);
		incise_stepper_info(c.stepper, &c.info);
		assert_string_equal(c.info.name, "bench motor 2 at incise-stepper0");
		assert_true(c.info.rate_max_hz == 20000);
		run_for(1000000);
		conformance[i].run(&c);
		c.stepper->ops->close(c.stepper);
		/* Closed while it was powered, it came to rest, and that is no fault. */
		assert_false(module.machine.enable);
		assert_false(module.pulser.motion.status.faults &
			     INCISE_STEPPER_FAULT_OWNER);
		assert_int_equal(module.opened, 0);
		assert_int_equal(module.mapped, 0);
		assert_int_equal(module.machine.too_short, 0);
	}
}

/* Two motors through one open file are asked of the real module, in tests/vm. */
TEST(a_motor_is_one_actuator_of_a_rig)
{
	struct incise_stepper *owner;
	struct incise_backend_request request = {
		.arguments = "/dev/incise-stepper0:2",
		.where = "rig.conf:3: stepper 2",
		.actuator = &actuator,
		.siblings = &owner,
		.n_siblings = 1,
	};

	module_load();
	owner = open_stepper("/dev/incise-stepper0:2", false, &actuator, NULL);
	assert_non_null(owner);
	assert_error(incise_stepper_kernel.open(&request, &err), EINVAL, &err,
		     "rig.conf:3: stepper 2: motor 2 of /dev/incise-stepper0");
	/* The first one goes on. */
	assert_int_equal(module.opened, 1);
	assert_int_equal(incise_stepper_enable(owner, NULL), 0);
	owner->ops->close(owner);
	assert_int_equal(module.opened, 0);
}

TEST(a_watcher_only_looks)
{
	struct incise_stepper_status status;
	struct incise_stepper *owner, *watcher;
	struct incise_stepper_info info;

	module_load();
	owner = open_stepper("/dev/incise-stepper0:2", false, &actuator, NULL);
	assert_int_equal(module.flags & O_ACCMODE, O_RDWR);
	watcher = open_stepper("/dev/incise/NAME:2", true, &actuator, &err);
	assert_non_null(watcher);
	assert_int_equal(module.flags & O_ACCMODE, O_RDONLY);
	assert_int_equal(module.mapped, 3);
	/* The owner's limits, not those of its own rig.conf. */
	incise_stepper_info(watcher, &info);
	assert_true(info.deadman_s == 0.07);
	assert_int_equal(incise_stepper_enable(owner, NULL), 0);
	assert_int_equal(incise_stepper_set(owner, 4), 0);
	run_for(90000000);
	assert_int_equal(incise_stepper_status(watcher, &status), 0);
	assert_true(status.position_mm > 0.1 &&
		    status.state == INCISE_STEPPER_STATE_MOVING);
	assert_int_equal(incise_stepper_set(watcher, 1), -EPERM);
	assert_int_equal(incise_stepper_jog(watcher, 1), -EPERM);
	assert_error(incise_stepper_enable(watcher, &err), EPERM, &err, "watch");
	assert_int_equal(incise_stepper_clear(watcher, &err), -EPERM);
	/* A watcher may stop the motor. */
	assert_true(module.machine.enable);
	assert_int_equal(incise_stepper_disable(watcher, &err), 0);
	assert_false(module.machine.enable);
	watcher->ops->close(watcher);
	owner->ops->close(owner);
}

TEST(why_it_does_not_open_is_said)
{
	static const struct {
		const char *arguments;
		int open_error, info_error, config_error, map_error;
		uint32_t n_motors, rate_max;
		int code;
		const char *says;
	} cases[] = {
		{"", 0, 0, 0, 0, 3, 20000, EINVAL, "path"},
		{"incise-stepper0", 0, 0, 0, 0, 3, 20000, EINVAL, "path"},
		{"/dev/incise-stepper0:9", 0, 0, 0, 0, 3, 20000, EINVAL, "motor"},
		{"/dev/incise-stepper0:", 0, 0, 0, 0, 3, 20000, EINVAL, "motor"},
		{"/dev/incise-stepper0:2", ENOENT, 0, 0, 0, 3, 20000, ENOENT,
		 "stepper.conf"},
		{"/dev/incise-stepper0:2", EACCES, 0, 0, 0, 3, 20000, EACCES,
		 "group incise"},
		{"/dev/incise-stepper0:2", EBUSY, 0, 0, 0, 3, 20000, EBUSY, "program"},
		{"/dev/incise-stepper0:2", 0, ENOTTY, 0, 0, 3, 20000, ENODEV, "version"},
		{"/dev/incise-stepper0:2", 0, ENODEV, 0, 0, 3, 20000, ENODEV,
		 "properties"},
		/* What it says of itself is not believed. */
		{"/dev/incise-stepper0:2", 0, 0, 0, 0, 99, 20000, EPROTO, NULL},
		{"/dev/incise-stepper0:2", 0, 0, 0, 0, 3, 0, EPROTO, NULL},
		{"/dev/incise-stepper0:2", 0, 0, 0, 0, 2, 20000, EINVAL, "0 to 1"},
		{"/dev/incise-stepper0:2", 0, 0, 0, 0, 3, 7999, ERANGE, "7999"},
		{"/dev/incise-stepper0:2", 0, 0, ERANGE, 0, 3, 20000, ERANGE, "actuator"},
		{"/dev/incise-stepper0:2", 0, 0, EINVAL, 0, 3, 20000, EINVAL, "actuator"},
		{"/dev/incise-stepper0:2", 0, 0, EBUSY, 0, 3, 20000, EBUSY, "rest"},
		{"/dev/incise-stepper0:2", 0, 0, 0, ENOMEM, 3, 20000, ENOMEM, "module"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		module_load();
		module.open_error = cases[i].open_error;
		module.info_error = cases[i].info_error;
		module.config_error = cases[i].config_error;
		module.map_error = cases[i].map_error;
		module.info.n_motors = cases[i].n_motors;
		module.info.rate_max = cases[i].rate_max;
		assert_error(open_stepper(cases[i].arguments, false, &actuator, &err),
			     cases[i].code, &err, cases[i].says);
		assert_int_equal(module.opened, 0);
		assert_int_equal(module.mapped, 0);
	}
}

TEST(what_the_last_owner_left_is_waited_for)
{
	struct incise_stepper *stepper;

	module_load();
	module.config_busy = 30;
	stepper = open_stepper("/dev/incise-stepper0:2", false, &actuator, NULL);
	assert_non_null(stepper);
	stepper->ops->close(stepper);
}

/* 4000 steps are the travel. */
TEST(a_count_outside_the_travel_begins_anew)
{
	static const struct {
		int64_t before, after;
		bool homed;
	} cases[] = {{4000, 4000, true}, {4001, 0, false}, {-1, 0, false}, {0, 0, true}};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_stepper_status status;
		struct incise_stepper *stepper;

		module_load();
		module.pulser.motion.status.position = cases[i].before;
		module.pulser.motion.status.flags = INCISE_STEPPER_FLAG_HOMED;
		stepper = open_stepper("/dev/incise-stepper0:2", false, &actuator, NULL);
		assert_non_null(stepper);
		assert_int_equal(incise_stepper_status(stepper, &status), 0);
		assert_true(status.position_mm == (double)cases[i].after * 0.00125);
		assert_int_equal(status.homed, cases[i].homed);
		stepper->ops->close(stepper);
	}
}

/* Unbound while it is open: the page says so, and all calls do. */
TEST(a_device_that_goes_away)
{
	struct incise_stepper_status status;
	struct incise_stepper *stepper;

	module_load();
	stepper = open_stepper("/dev/incise-stepper0:2", false, &actuator, NULL);
	assert_int_equal(incise_stepper_enable(stepper, NULL), 0);
	incise_pulser_fault(&module.pulser, INCISE_STEPPER_FAULT_GONE);
	assert_int_equal(incise_stepper_set(stepper, 1), -ENODEV);
	assert_int_equal(incise_stepper_status(stepper, &status), -ENODEV);
	assert_int_equal(status.faults, INCISE_STEPPER_FAULT_GONE);
	run_for(100000000);
	assert_error(incise_stepper_enable(stepper, &err), EPERM, &err, "removed");
	stepper->ops->close(stepper);
}

/* A status that is never finished is not waited for, and is reported after a while. */
TEST(a_page_that_makes_no_sense)
{
	struct incise_stepper_motor_status *slot =
		(struct incise_stepper_motor_status *)module.status + MOTOR;
	struct incise_stepper_status status;
	struct incise_stepper *stepper;
	int rc = 0, looks = 0;

	module_load();
	stepper = open_stepper("/dev/incise-stepper0:2", false, &actuator, NULL);
	assert_int_equal(incise_stepper_status(stepper, &status), 0);
	slot->seq |= 1;
	while (!rc && looks++ < 1000)
		rc = incise_stepper_status(stepper, &status);
	assert_int_equal(rc, -EIO);
	assert_in_range(looks, 50, 200);
	memset(slot, 0xfe, sizeof(*slot));
	assert_int_equal(incise_stepper_status(stepper, &status), -EIO);
	assert_int_equal(incise_stepper_set(stepper, 1), -EIO);
	stepper->ops->close(stepper);
}
