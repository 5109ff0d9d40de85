// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A stepper on the kernel module incise_stepper: "kernel:/dev/incise-stepper0", or
 * "kernel:/dev/incise-stepper0:2" for its third motor. Targets and status go through two
 * mapped pages, without a system call; settings at rest by ioctl. See
 * driver/uapi/incise_stepper.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>
#include <incise/clock.h>
#include "../../base/monotonic.h"
#include "../../rig/backends.h"
#include "../../rig/motor.h"
#include "../../rig/page.h"

#define REST_POLL_NS 10000000
#define REST_POLLS 500

struct kernel_stepper {
	struct incise_motor motor;
	struct incise_stepper_ops ops; /* of motors, and of plans */
	char path[PATH_MAX];
	unsigned int index; /* of the motor */
	int fd;
	size_t page;
	void *setpoints, *status; /* pages; NULL or MAP_FAILED: not mapped */
};

static struct kernel_stepper *stepper_kernel_of(struct incise_motor *motor)
{
	return (struct kernel_stepper *)motor;
}

static int request(const struct kernel_stepper *k, unsigned long number, void *argument)
{
	/* A lost device answers ENODEV for good. */
	return ioctl(k->fd, number, argument) < 0 ? -errno : 0;
}

static int on_mask(struct incise_motor *motor, unsigned long number)
{
	__u32 mask = 1u << stepper_kernel_of(motor)->index;

	return request(stepper_kernel_of(motor), number, &mask);
}

static int kernel_enable(struct incise_motor *motor, struct incise_error *err)
{
	int rc = on_mask(motor, INCISE_STEPPER_ENABLE);

	if (rc == -ENOSPC)
		return incise_error_set(
			err, ENOSPC,
			"%s: cannot be enabled: motors of other controllers leave no time on "
			"its CPU; give a smaller velocity_mm_s, or another CPU (--cpu)",
			motor->name);
	/* A latched fault, as incise_stepper_enable() names it. */
	return rc == -ENOTRECOVERABLE ? -EPERM : rc;
}

static int kernel_disable(struct incise_motor *motor)
{
	return on_mask(motor, INCISE_STEPPER_DISABLE);
}

static int kernel_clear(struct incise_motor *motor, struct incise_error *err)
{
	(void)err;
	return on_mask(motor, INCISE_STEPPER_CLEAR);
}

static int kernel_origin(struct incise_motor *motor, int32_t steps, bool homed)
{
	struct incise_stepper_origin origin = {.motor = stepper_kernel_of(motor)->index,
					       .homed = homed,
					       .position = steps};

	return request(stepper_kernel_of(motor), INCISE_STEPPER_SET_POSITION, &origin);
}

static INCISE_REALTIME int64_t kernel_now(struct incise_motor *motor)
{
	(void)motor;
	return incise_monotonic_ns();
}

static void unmap(const struct kernel_stepper *k, void *page)
{
	if (page && page != MAP_FAILED)
		munmap(page, k->page);
}

/* Disable first: the module would stop the motor by itself, but with a fault latched. */
static void kernel_close(struct incise_motor *motor)
{
	struct kernel_stepper *k = stepper_kernel_of(motor);

	if (motor->slot && !motor->watches)
		motor->stepper.ops->disable(&motor->stepper, NULL);
	unmap(k, k->setpoints);
	unmap(k, k->status);
	if (k->fd >= 0)
		close(k->fd);
	free(k);
}

static const struct incise_motor_ops kernel_ops = {
	.enable = kernel_enable,
	.disable = kernel_disable,
	.clear = kernel_clear,
	.origin = kernel_origin,
	.close = kernel_close,
	.now = kernel_now,
};

/* --- plans ------------------------------------------------------------------------------ */

static const struct kernel_stepper *of_stepper(const struct incise_stepper *stepper)
{
	return (const struct kernel_stepper *)stepper;
}

static bool is_kernel(const struct incise_stepper *stepper);

/* In the order of their numbers, on one controller, opened to drive. */
static int plan_motors(struct incise_stepper *const *steppers, int n, __u32 *mask,
		       struct incise_error *err)
{
	const struct kernel_stepper *first = of_stepper(steppers[0]);
	unsigned int least = 0;

	*mask = 0;
	for (int i = 0; i < n; i++) {
		const struct kernel_stepper *k = of_stepper(steppers[i]);

		if (!is_kernel(steppers[i]) || strcmp(k->path, first->path))
			return incise_error_set(
				err, EINVAL,
				"a plan needs motors of one controller, but %s is not "
				"on %s; correct rig.conf",
				is_kernel(steppers[i]) ? k->path : "an actuator",
				first->path);
		if (i && k->index < least)
			return incise_error_set(
				err, EINVAL,
				"%s: motor %u comes before motor %u: name the actuators "
				"in rig.conf in the order of their motors",
				k->path, k->index, least - 1);
		if (k->motor.watches)
			return incise_error_set(err, EPERM, "%s: opened only to watch",
						k->path);
		least = k->index + 1;
		*mask |= 1u << k->index;
	}
	return 0;
}

static int plan_load(struct incise_stepper *const *steppers, int n, const void *bytes,
		     size_t size, struct incise_error *err)
{
	const struct kernel_stepper *first = of_stepper(steppers[0]);
	struct incise_stepper_plan plan = {.data = (uintptr_t)bytes, .size = size};
	int rc = plan_motors(steppers, n, &plan.motors, err);

	if (rc)
		return rc;
	rc = request(first, INCISE_STEPPER_LOAD_PLAN, &plan);
	switch (rc) {
	case 0:
		return 0;
	case -ENOTTY:
	case -EOPNOTSUPP:
		return incise_error_set(
			err, ENOTSUP,
			"%s: its module cannot run plans of this version; load the "
			"module of this version (modinfo incise_stepper)",
			first->path);
	case -ERANGE:
		return incise_error_set(
			err, ERANGE,
			"%s: deadman_ms in rig.conf is not longer than the plan's pose "
			"age and fade, tick_us is longer than a tick of the plan, or "
			"this machine is too slow; see `incise info` of both",
			first->path);
	case -EBUSY:
		return incise_error_set(err, EBUSY,
					"%s: a motor is on, or still decelerates; "
					"disable it",
					first->path);
	default:
		return incise_error_set(err, -rc, "%s: rejects the plan: %s", first->path,
					strerror(-rc));
	}
}

static INCISE_REALTIME int plan_follow(struct incise_stepper *stepper)
{
	struct incise_motor *motor = (struct incise_motor *)stepper;
	int rc = incise_motor_drivable(motor);

	if (!rc)
		incise_page_put_setpoint(motor->setpoint, INCISE_STEPPER_MODE_POSE, 0,
					 motor->ops->now(motor));
	return rc;
}

/* To the nearest integer that fits; 0 for NaN. */
static INCISE_REALTIME __s32 to_integer(double value, double one)
{
	double scaled = value * one;

	if (!isfinite(scaled))
		return 0;
	return (__s32)lrint(fmax(INT32_MIN, fmin(INT32_MAX, scaled)));
}

static INCISE_REALTIME int plan_pose(struct incise_stepper *first,
				     const struct incise_stepper_pose_given *given)
{
	struct kernel_stepper *k = (struct kernel_stepper *)first;
	const struct incise_tracker_sample *sample = given->sample;
	struct incise_stepper_pose pose = {0};
	int rc = incise_motor_drivable(&k->motor);

	if (rc)
		return rc;
	for (int i = 0; sample && i < 3; i++) {
		if (!isfinite(sample->position_mm[i]))
			return -EDOM;
		pose.position[i] = to_integer(sample->position_mm[i], 65536);
	}
	for (int i = 0; sample && i < 4; i++)
		pose.quaternion[i] = to_integer(sample->quaternion[i], 1073741824);
	/* An invalid quaternion leaves the attitude as it was; 0 is no pose. */
	pose.quaternion[0] += sample && !pose.quaternion[0];
	if (!given->tube)
		pose.tool =
			(__u32)given->tool | (given->fade ? INCISE_STEPPER_POSE_FADE : 0);
	incise_page_put_pose(given->tube
				     ? (struct incise_stepper_setpoint *)k->setpoints +
					       INCISE_STEPPER_SLOT_TUBE
				     : k->motor.setpoint,
			     &pose, sample ? sample->t_ns : k->motor.ops->now(&k->motor));
	return 0;
}

static INCISE_REALTIME void to_double(double *to, const __s32 *from, int n, double one)
{
	for (int i = 0; i < n; i++)
		to[i] = from[i] / one;
}

static INCISE_REALTIME int plan_rendered(struct incise_stepper *stepper,
					 struct incise_stepper_rendered *to)
{
	const struct kernel_stepper *k = of_stepper(stepper);
	const struct incise_stepper_motor_status *slots = k->status;
	struct incise_stepper_plan_status from;
	int rc = incise_page_get_plan(
		(const struct incise_stepper_plan_status *)(slots +
							    INCISE_STEPPER_SLOT_PLAN),
		&from);

	if (rc)
		return rc;
	*to = (struct incise_stepper_rendered){
		.state = (enum incise_stepper_plan_state)from.state,
		.reasons = from.reasons,
		.plan = from.plan,
		.ticks = from.ticks,
		.missed = from.missed,
		.poses = from.poses,
		.refused = from.refused,
		.t_ns = from.t_ns,
		.age_ns = from.age_ns,
		.flags = from.flags,
		.phase = (enum incise_phase)from.phase,
		.held = (enum incise_tool)from.held,
		.depth_mm = from.depth / 65536.0,
		.speed_mm_s = from.speed / 65536.0,
	};
	to_double(to->tool_mm, from.tool, 3, 65536);
	to_double(to->proxy_mm, from.proxy, 3, 65536);
	to_double(to->normal, from.normal, 3, 1073741824);
	to_double(to->quaternion, from.quaternion, 4, 1073741824);
	to_double(to->command_N, from.command, 3, 65536);
	to_double(to->along_N, from.along, 3, 65536);
	return 0;
}

static const struct incise_stepper_plan_ops plan_ops = {
	.load = plan_load,
	.follow = plan_follow,
	.pose = plan_pose,
	.rendered = plan_rendered,
};

static bool is_kernel(const struct incise_stepper *stepper)
{
	return stepper->ops->plan == &plan_ops;
}

/* --- opening ---------------------------------------------------------------------------- */

/* PATH or PATH:MOTOR. */
static int parse_stepper_kernel(struct kernel_stepper *k,
				const struct incise_backend_request *asked,
				struct incise_error *err)
{
	const char *text = asked->arguments, *colon = strrchr(text, ':');
	size_t length = colon ? (size_t)(colon - text) : strlen(text);

	if (colon && (strlen(colon) != 2 || colon[1] < '0' ||
		      colon[1] >= '0' + INCISE_STEPPER_MOTORS_MAX))
		return incise_error_set(
			err, EINVAL,
			"%s: expected kernel:/dev/incise-stepper0 or, for its third motor, "
			"kernel:/dev/incise-stepper0:2, found kernel:%.60s; correct it",
			asked->where, text);
	if (*text != '/' || length >= sizeof(k->path))
		return incise_error_set(
			err, EINVAL,
			"%s: expected the path of a device, for example "
			"kernel:/dev/incise-stepper0, found kernel:%.60s; correct it",
			asked->where, text);
	memcpy(k->path, text, length);
	k->index = colon ? (unsigned int)(colon[1] - '0') : 0;
	return 0;
}

/*
 * A controller has one owner, who drives all of its motors: another motor of a device that this
 * rig has opened already goes through the same open file. Returns 1 without one.
 */
static int join_sibling(struct kernel_stepper *k,
			const struct incise_backend_request *asked,
			struct incise_error *err)
{
	for (int i = 0; i < asked->n_siblings; i++) {
		const struct kernel_stepper *other =
			(const struct kernel_stepper *)asked->siblings[i];

		if (strcmp(other->path, k->path))
			continue;
		if (other->index == k->index)
			return incise_error_set(
				err, EINVAL,
				"%s: motor %u of %.200s is already an actuator of this "
				"rig; name another",
				asked->where, k->index, k->path);
		k->fd = fcntl(other->fd, F_DUPFD_CLOEXEC, 0);
		return k->fd >= 0
			       ? 0
			       : incise_error_set(err, errno, "%s: %.200s: %s",
						  asked->where, k->path, strerror(errno));
	}
	return 1;
}

static int open_device(struct kernel_stepper *k,
		       const struct incise_backend_request *asked,
		       struct incise_error *err)
{
	const char *todo;
	struct stat status;
	int rc = join_sibling(k, asked, err);

	if (rc <= 0)
		return rc;
	/* O_NONBLOCK: to open a pipe would wait for a writer. */
	k->fd = open(k->path,
		     (asked->watch ? O_RDONLY : O_RDWR) | O_CLOEXEC | O_NONBLOCK);
	if (k->fd >= 0 && !fstat(k->fd, &status) && !S_ISCHR(status.st_mode)) {
		close(k->fd);
		k->fd = -1;
		errno = ENOTTY;
	}
	if (k->fd >= 0)
		return 0;
	switch (errno) {
	case ENOENT:
	case ENXIO:
	case ENODEV:
		todo = "no such device: name its lines in /etc/incise/stepper.conf and "
		       "run 'systemctl start incise-stepper', or name another";
		break;
	case EACCES:
	case EPERM:
		todo = "not permitted: become a member of the group incise, or root";
		break;
	case EBUSY:
		todo = "another program drives it: end it (incise haptic and its "
		       "service, incise stepper), or only watch";
		break;
	case ENOTTY:
		todo = "not a device; name one of incise_stepper, for example "
		       "/dev/incise-stepper0";
		break;
	default:
		todo = strerror(errno);
	}
	return incise_error_set(err, errno, "%s: %.200s: %s", asked->where, k->path,
				todo);
}

/* Check the answer of the module, as its sizes lead to memory. */
static int check_info(const struct kernel_stepper *k,
		      struct incise_stepper_controller *info,
		      const struct incise_backend_request *asked,
		      struct incise_error *err)
{
	int rc = request(k, INCISE_STEPPER_GET_INFO, info);

	if (rc == -ENOTTY)
		return incise_error_set(
			err, ENODEV,
			"%s: %.200s: not an incise stepper, or its module has another "
			"version; see `modinfo incise_stepper`",
			asked->where, k->path);
	if (!rc && (!info->n_motors || info->n_motors > INCISE_STEPPER_MOTORS_MAX ||
		    !info->rate_max))
		rc = -EPROTO;
	if (rc)
		return incise_error_set(err, -rc,
					"%s: %.200s: its properties cannot be read: "
					"%s; load its module again",
					asked->where, k->path, strerror(-rc));
	if (k->index >= info->n_motors)
		return incise_error_set(
			err, EINVAL,
			"%s: %.200s: has motors 0 to %u, found %u; correct "
			"it",
			asked->where, k->path, info->n_motors - 1, k->index);
	return 0;
}

static int configure(struct kernel_stepper *k,
		     const struct incise_stepper_controller *info,
		     const struct incise_backend_request *asked, struct incise_error *err)
{
	uint32_t high_ns = k->motor.actuator.high_ns;
	struct incise_stepper_config config, bound = {.motor = k->index};
	int rc;

	rc = incise_motor_fit(&k->motor.actuator, asked->where, info->rate_max,
			      info->pulse_ns,
			      high_ns && high_ns <= INCISE_STEPPER_WAIT_MAX_NS
				      ? info->wait_step_ns
				      : info->step_ns,
			      err);
	if (rc)
		return rc;
	incise_motor_config(&k->motor.actuator, k->index, &config);
	if (config.tick_ns < info->tick_min_ns)
		return incise_error_set(
			err, ERANGE,
			"%s: tick_us is %g, but this machine needs at least %g with %u "
			"motors (by its self-test); correct it in rig.conf",
			asked->where, config.tick_ns / 1e3, info->tick_min_ns / 1e3,
			info->n_motors);
	/* The wiring has these, rig.conf has not. */
	if (!request(k, INCISE_STEPPER_GET_CONFIG, &bound)) {
		config.cpu = bound.cpu;
		config.debounce_ns = bound.debounce_ns;
	}
	rc = request(k, INCISE_STEPPER_SET_CONFIG, &config);
	/* A motor that the last owner left in motion is still coming to rest. */
	for (int i = 0; rc == -EBUSY && i < REST_POLLS; i++) {
		nanosleep(&(struct timespec){.tv_nsec = REST_POLL_NS}, NULL);
		rc = request(k, INCISE_STEPPER_SET_CONFIG, &config);
	}
	if (!rc)
		return 0;
	return incise_error_set(
		err, -rc,
		rc == -EBUSY
			? "%s: %.200s: its motor does not come to rest: %s; switch it "
			  "off"
			: "%s: %.200s: rejects the group actuator: %s; see `dmesg`",
		asked->where, k->path, strerror(-rc));
}

/* A watcher shows the limits of the owner. */
static int adopt(struct kernel_stepper *k)
{
	struct incise_stepper_config config = {.motor = k->index};
	int rc = request(k, INCISE_STEPPER_GET_CONFIG, &config);

	if (!rc && config.deadman_ns)
		k->motor.actuator.deadman_s = (double)config.deadman_ns / INCISE_NS_PER_S;
	return rc;
}

/* Populate now: a page first touched in the loop would make a tick late. */
static int map_pages(struct kernel_stepper *k, bool watch)
{
	off_t page = (off_t)k->page;

	k->status = mmap(NULL, k->page, PROT_READ, MAP_SHARED | MAP_POPULATE, k->fd,
			 INCISE_STEPPER_PAGE_STATUS * page);
	if (k->status == MAP_FAILED)
		return -errno;
	k->motor.slot = (const struct incise_stepper_motor_status *)k->status + k->index;
	if (watch)
		return 0;
	k->setpoints =
		mmap(NULL, k->page, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE,
		     k->fd, INCISE_STEPPER_PAGE_SETPOINTS * page);
	if (k->setpoints == MAP_FAILED)
		return -errno;
	k->motor.setpoint = (struct incise_stepper_setpoint *)k->setpoints + k->index;
	return 0;
}

/*
 * The module's count goes on from one owner to the next. A position outside of this travel
 * restarts at 0, and is not homed.
 */
static int take_count(struct kernel_stepper *k)
{
	double most = incise_actuator_steps(&k->motor.actuator, HUGE_VAL);
	struct incise_stepper_motor_status status;
	int rc = incise_page_get_status(k->motor.slot, &status);

	if (rc || (status.position >= 0 && (double)status.position <= most))
		return rc;
	return kernel_origin(&k->motor, 0, false);
}

static int set_up_stepper_kernel(struct kernel_stepper *k,
				 const struct incise_backend_request *asked,
				 struct incise_error *err)
{
	struct incise_stepper_controller info = {0};
	int rc = parse_stepper_kernel(k, asked, err);

	if (!rc)
		rc = open_device(k, asked, err);
	if (!rc)
		rc = check_info(k, &info, asked, err);
	if (rc)
		return rc;
	k->motor.rate_max_hz = info.rate_max;
	k->motor.lines = info.lines[k->index];
	snprintf(k->motor.name, sizeof(k->motor.name), "%.31s motor %u at %.16s",
		 info.name, k->index, strrchr(k->path, '/') + 1);
	if (!asked->watch)
		rc = configure(k, &info, asked, err);
	if (rc)
		return rc;
	rc = asked->watch ? adopt(k) : 0;
	if (!rc)
		rc = map_pages(k, asked->watch);
	if (!rc && !asked->watch)
		rc = take_count(k);
	return rc ? incise_error_set(err, -rc, "%s: %.200s: %s; load its module again",
				     asked->where, k->path, strerror(-rc))
		  : 0;
}

static void *kernel_open(const struct incise_backend_request *asked,
			 struct incise_error *err)
{
	struct kernel_stepper *k = incise_backend_alloc(sizeof(*k), asked->where, err);
	int rc;

	if (!k)
		return NULL;
	k->fd = -1;
	k->page = (size_t)sysconf(_SC_PAGESIZE);
	k->motor.ops = &kernel_ops;
	k->motor.actuator = *asked->actuator;
	k->motor.watches = asked->watch;
	incise_motor_init(&k->motor);
	k->ops = *k->motor.stepper.ops;
	k->ops.plan = &plan_ops;
	k->motor.stepper.ops = &k->ops;
	rc = set_up_stepper_kernel(k, asked, err);
	if (!rc)
		return &k->motor.stepper;
	kernel_close(&k->motor);
	errno = -rc;
	return NULL;
}

INCISE_BACKEND(incise_stepper_kernel, "stepper", "kernel", .open = kernel_open);
