// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Controllers of the kernel module; see module.h. Read from /dev/incise-stepperN and debugfs
 * without becoming the owner, so a running motion is not disturbed. Steps and nanoseconds.
 */
#include <errno.h>
#include <fcntl.h>
#include <glob.h>
#include <inttypes.h>
#include <libgen.h>
#include <limits.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <incise/haptic_page.h>
#include <uapi/incise_stepper.h>
#include <unistd.h>
#include "../cli/cli.h"
#include "../cli/json.h"
#include "module.h"
#include "status.h"

#define DEVICES "/dev/incise-stepper*"
#define DEBUGFS "/sys/kernel/debug/incise_stepper"
#define TRIES 1000
#define BINS 64
#define KHZ 1e-3
#define US 1e-3 /* of ns */

/* Firings of a timer, in bins of µs that double; the last is open. */
struct histogram {
	uint64_t count[BINS];
	uint64_t mean_ns, max_ns;
};

struct motor {
	struct incise_stepper_config config;
	struct incise_stepper_motor_status status;
	struct histogram lateness, cost; /* of the hard timer */
	uint64_t edges;
};

struct controller {
	const char *path;
	struct incise_stepper_controller info;
	struct incise_stepper_sync sync;
	bool has_sync;
	bool has_debugfs;	/* histograms and edges were read */
	const char *no_debugfs; /* else why not */
	int bins;
	uint32_t from_us[BINS];
	struct motor motor[INCISE_STEPPER_MOTORS_MAX];
};

/* --- reading ------------------------------------------------------------------------- */

static void read_status(struct controller *controller, int fd)
{
	size_t size = (size_t)sysconf(_SC_PAGESIZE);
	void *page = mmap(NULL, size, PROT_READ, MAP_SHARED, fd,
			  (off_t)(INCISE_STEPPER_PAGE_STATUS * size));
	struct incise_stepper_motor_status *slots = page;

	if (page == MAP_FAILED)
		cli_fail("%s: mapping its status: %s", controller->path, strerror(errno));
	for (uint32_t i = 0; i < controller->info.n_motors; i++)
		for (int n = 0; !incise_haptic_page_get(
			     &slots[i], &controller->motor[i].status, sizeof(slots[i]));
		     n++)
			if (n == TRIES)
				cli_fail(
					"%s: the status of motor %u changed each time it was "
					"read; try again",
					controller->path, i);
	munmap(page, size);
}

/* The rest of a line as numbers, one per motor. */
static bool numbers(char *text, uint64_t *value, uint32_t n)
{
	for (uint32_t i = 0; i < n; i++) {
		char *end;

		value[i] = strtoull(text, &end, 10);
		if (end == text)
			return false;
		text = end;
	}
	return true;
}

static FILE *open_debugfs(const struct controller *controller, const char *file)
{
	char real[PATH_MAX], path[PATH_MAX + 100];

	/* A link that udev made has another name. */
	if (!realpath(controller->path, real))
		return NULL;
	snprintf(path, sizeof(path), DEBUGFS "/%s/%s", basename(real), file);
	return fopen(path, "re");
}

/*
 * "from_us motor0 motor1 …", then a line per bin, "mean_ns …" and "max_ns …".
 * @cost: which of a motor's two
 */
static bool read_histogram(struct controller *controller, const char *file, bool cost)
{
	FILE *stream = open_debugfs(controller, file);
	uint64_t value[INCISE_STEPPER_MOTORS_MAX];
	uint32_t n = controller->info.n_motors;
	char line[400];
	int bins = 0;
	bool ok = stream && fgets(line, sizeof(line), stream);

	while (ok && fgets(line, sizeof(line), stream)) {
		char *rest = line + strcspn(line, " ");
		bool mean = !strncmp(line, "mean_ns ", 8);
		bool max = !strncmp(line, "max_ns ", 7);

		ok = numbers(rest, value, n) && (mean || max || bins < BINS);
		for (uint32_t i = 0; ok && i < n; i++) {
			struct motor *motor = &controller->motor[i];
			struct histogram *h = cost ? &motor->cost : &motor->lateness;

			*(mean	? &h->mean_ns
			  : max ? &h->max_ns
				: &h->count[bins]) = value[i];
		}
		if (ok && !mean && !max)
			controller->from_us[bins++] = (uint32_t)strtoul(line, NULL, 10);
	}
	if (stream)
		fclose(stream);
	controller->bins = bins;
	return ok && bins;
}

/* The edges in "motor=0 edges=7 …", which the status page does not have. */
static bool read_counters(struct controller *controller)
{
	FILE *stream = open_debugfs(controller, "counters");
	char line[400];
	uint32_t motor;
	uint64_t edges;

	while (stream && fgets(line, sizeof(line), stream))
		if (sscanf(line, "motor=%" SCNu32 " edges=%" SCNu64, &motor, &edges) ==
			    2 &&
		    motor < controller->info.n_motors)
			controller->motor[motor].edges = edges;
	if (stream)
		fclose(stream);
	return stream;
}

static void read_debugfs(struct controller *controller)
{
	controller->has_debugfs = read_counters(controller) &&
				  read_histogram(controller, "lateness", false) &&
				  read_histogram(controller, "cost", true);
	if (controller->has_debugfs)
		return;
	controller->no_debugfs = geteuid() ? "only root may read debugfs"
					   : "there is no " DEBUGFS
					     "; see whether debugfs is mounted";
}

static void query(struct controller *controller, int fd, unsigned long what, void *answer)
{
	if (!ioctl(fd, what, answer))
		return;
	close(fd);
	if (errno == ENOTTY || errno == EINVAL)
		cli_fail("%s: not a controller of incise_stepper, or one of another "
			 "version; see incise info stepper",
			 controller->path);
	cli_fail("%s: %s", controller->path, strerror(errno));
}

static void read_controller(struct controller *controller, const char *path)
{
	int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);

	*controller = (struct controller){.path = path};
	if (fd < 0 && errno == EACCES)
		cli_fail("%s: %s; join the group incise, or run as root", path,
			 strerror(errno));
	if (fd < 0)
		cli_fail("%s: %s; incise info stepper lists the controllers", path,
			 strerror(errno));
	query(controller, fd, INCISE_STEPPER_GET_INFO, &controller->info);
	if (controller->info.n_motors > INCISE_STEPPER_MOTORS_MAX)
		cli_fail("%s: it reports %u motors: module and program are of "
			 "different versions",
			 path, controller->info.n_motors);
	for (uint32_t i = 0; i < controller->info.n_motors; i++) {
		controller->motor[i].config.motor = i;
		query(controller, fd, INCISE_STEPPER_GET_CONFIG,
		      &controller->motor[i].config);
	}
	controller->has_sync = controller->info.capabilities & INCISE_STEPPER_CAP_SYNC;
	if (controller->has_sync)
		query(controller, fd, INCISE_STEPPER_GET_SYNC, &controller->sync);
	read_status(controller, fd);
	read_debugfs(controller);
	close(fd);
}

/* --- the report ---------------------------------------------------------------------- */

bool stepper_module_is(const char *what)
{
	return !strcmp(what, "stepper") || !strncmp(what, DEVICES, strlen(DEVICES) - 1);
}

static double velocity_steps_s(const struct motor *motor)
{
	return (double)motor->status.velocity / 65536;
}

static void put_bits(const char *title, uint32_t bits, const char *const *names, size_t n)
{
	printf("  %-10s", title);
	for (size_t i = 0; i < n; i++)
		if (bits & 1u << i)
			printf(" %s", names[i]);
	puts(bits ? "" : " none");
}

static void put_config(const struct incise_stepper_config *c)
{
	printf("  limits     steps %" PRId64 " to %" PRId64
	       ", %u steps/s, %u steps/s^2, jerk ",
	       (int64_t)c->position_min, (int64_t)c->position_max, c->velocity,
	       c->acceleration);
	if (c->jerk)
		printf("%" PRIu64 " steps/s^3\n", (uint64_t)c->jerk);
	else
		puts("not limited");
	printf("  pulses     high %g us, low %g us, direction set up %g us, held %g us%s\n",
	       c->high_ns * US, c->low_ns * US, c->setup_ns * US, c->hold_ns * US,
	       c->flags & INCISE_STEPPER_CONFIG_INVERT ? ", inverted" : "");
	printf("  times      tick %g us, deadman %g ms%s, enable %g ms, fault after %u late "
	       "edges in a row\n",
	       c->tick_ns * US, (double)c->deadman_ns * 1e-6,
	       c->flags & INCISE_STEPPER_CONFIG_RETRACT
		       ? " (then back to a safe position)"
		       : "",
	       (double)c->enable_ns * 1e-6, c->late_max);
}

static void put_histograms(const struct controller *controller, const struct motor *motor)
{
	uint64_t firings = 0;

	for (int i = 0; i < controller->bins; i++)
		firings += motor->lateness.count[i];
	printf("  timer      %" PRIu64
	       " firings, late by %.3f us on average and %.3f us at "
	       "most\n  callback   %.3f us on average, %.3f us at most\n",
	       firings, (double)motor->lateness.mean_ns * US,
	       (double)motor->lateness.max_ns * US, (double)motor->cost.mean_ns * US,
	       (double)motor->cost.max_ns * US);
	if (firings)
		puts("  from us    firings late    callbacks of that duration");
	for (int i = 0; i < controller->bins; i++)
		if (motor->lateness.count[i] || motor->cost.count[i])
			printf("  %7u %15" PRIu64 " %15" PRIu64 "\n",
			       controller->from_us[i], motor->lateness.count[i],
			       motor->cost.count[i]);
}

static void put_motor(const struct controller *controller, uint32_t i)
{
	const struct motor *motor = &controller->motor[i];
	const struct incise_stepper_motor_status *s = &motor->status;

	printf("motor %u: %s at step %" PRId64 ", target %" PRId64 ", %.0f steps/s, %s\n",
	       i, incise_stepper_state_name(s->state), (int64_t)s->position,
	       (int64_t)s->target, velocity_steps_s(motor),
	       s->flags & INCISE_STEPPER_FLAG_HOMED ? "homed" : "not homed");
	put_bits("lines", controller->info.lines[i], stepper_line_keys, STEPPER_LINES);
	if (controller->info.polled[i])
		put_bits("polled", controller->info.polled[i], stepper_line_keys,
			 STEPPER_LINES);
	put_bits("active", s->inputs, stepper_line_keys, STEPPER_LINES);
	put_bits("faults", s->faults, stepper_fault_keys, INCISE_STEPPER_FAULTS);
	put_config(&motor->config);
	printf("  steps      %" PRIu64 " up, %" PRIu64 " down; %" PRIu64
	       " edges late, the motion delayed by %g us\n",
	       (uint64_t)s->steps_up, (uint64_t)s->steps_down, (uint64_t)s->late,
	       (double)s->shifted_ns * US);
	if (controller->has_debugfs)
		put_histograms(controller, motor);
}

static void put_sync(const struct controller *controller)
{
	const struct incise_stepper_sync *sync = &controller->sync;

	if (!controller->has_sync)
		puts("sync       no line");
	else if (!sync->period_ns)
		puts("sync       off");
	else
		printf("sync       every %g ms for %g us: %s, %" PRIu64 " left out\n",
		       (double)sync->period_ns * 1e-6, sync->width_ns * US,
		       cli_count(sync->pulses, "pulse"), (uint64_t)sync->missed);
}

static void put_module_text(const struct controller *controller)
{
	const struct incise_stepper_controller *info = &controller->info;

	printf("%s: %.*s, %s\n", controller->path, (int)sizeof(info->name), info->name,
	       cli_count(info->n_motors, "motor"));
	printf("self-test  99 %% of timers at most %.3f us late, the latest %.3f us; an edge "
	       "takes %.3f us\n           so at most %.1f kHz, pulses of at least %.3f us, ticks of "
	       "at least %g us; timers of %u ns\n",
	       info->lateness_ns * US, info->lateness_max_ns * US, info->edge_ns * US,
	       info->rate_max * KHZ, info->pulse_ns * US, info->tick_min_ns * US,
	       info->resolution_ns);
	put_sync(controller);
	for (uint32_t i = 0; i < info->n_motors; i++)
		put_motor(controller, i);
	if (!controller->has_debugfs)
		printf("lateness and callback cost are not known: %s\n",
		       controller->no_debugfs);
}

static json_t *config_json(const struct incise_stepper_config *c)
{
	return json_pack(
		"{sI sI sI sI sI sI sI sI sI sI sI sI sI sI sb sb}", "tick_ns",
		(json_int_t)c->tick_ns, "velocity_steps_s", (json_int_t)c->velocity,
		"acceleration_steps_s2", (json_int_t)c->acceleration, "jerk_steps_s3",
		(json_int_t)c->jerk, "position_min_steps", (json_int_t)c->position_min,
		"position_max_steps", (json_int_t)c->position_max, "safe_position_steps",
		(json_int_t)c->safe_position, "deadman_ns", (json_int_t)c->deadman_ns,
		"high_ns", (json_int_t)c->high_ns, "low_ns", (json_int_t)c->low_ns,
		"setup_ns", (json_int_t)c->setup_ns, "hold_ns", (json_int_t)c->hold_ns,
		"enable_ns", (json_int_t)c->enable_ns, "late_max",
		(json_int_t)c->late_max, "invert",
		(int)!!(c->flags & INCISE_STEPPER_CONFIG_INVERT), "retract",
		(int)!!(c->flags & INCISE_STEPPER_CONFIG_RETRACT));
}

/* Bins that are not empty: [from_us, count]. */
static json_t *histogram_json(const struct controller *controller,
			      const struct histogram *h)
{
	json_t *bins = json_array();

	if (!controller->has_debugfs) {
		json_decref(bins);
		return json_null();
	}
	for (int i = 0; i < controller->bins; i++)
		if (h->count[i])
			json_array_append_new(
				bins,
				json_pack("[II]", (json_int_t)controller->from_us[i],
					  (json_int_t)h->count[i]));
	return json_pack("{sI sI so}", "mean_ns", (json_int_t)h->mean_ns, "max_ns",
			 (json_int_t)h->max_ns, "histogram_us", bins);
}

static json_t *motor_json(const struct controller *controller, uint32_t i)
{
	const struct motor *motor = &controller->motor[i];
	const struct incise_stepper_motor_status *s = &motor->status;

	return json_pack(
		"{ss sI sI sf sb so so so so so sI sI sI sI so so so}", "state",
		incise_stepper_state_name(s->state), "position_steps",
		(json_int_t)s->position, "target_steps", (json_int_t)s->target,
		"velocity_steps_s", velocity_steps_s(motor), "homed",
		(int)!!(s->flags & INCISE_STEPPER_FLAG_HOMED), "lines",
		json_bits(controller->info.lines[i], stepper_line_keys, STEPPER_LINES),
		"polled",
		json_bits(controller->info.polled[i], stepper_line_keys, STEPPER_LINES),
		"inputs", json_bits(s->inputs, stepper_line_keys, STEPPER_LINES),
		"faults", json_bits(s->faults, stepper_fault_keys, INCISE_STEPPER_FAULTS),
		"config", config_json(&motor->config), "steps_up",
		(json_int_t)s->steps_up, "steps_down", (json_int_t)s->steps_down,
		"late_edges", (json_int_t)s->late, "shifted_ns",
		(json_int_t)s->shifted_ns, "edges",
		controller->has_debugfs ? json_integer((json_int_t)motor->edges)
					: json_null(),
		"lateness", histogram_json(controller, &motor->lateness), "callback",
		histogram_json(controller, &motor->cost));
}

static json_t *sync_json(const struct controller *controller)
{
	const struct incise_stepper_sync *sync = &controller->sync;

	if (!controller->has_sync)
		return json_null();
	return json_pack("{sI sI sI sI sI sI}", "period_ns", (json_int_t)sync->period_ns,
			 "width_ns", (json_int_t)sync->width_ns, "first_ns",
			 (json_int_t)sync->first_ns, "pulses", (json_int_t)sync->pulses,
			 "last_ns", (json_int_t)sync->last_ns, "missed",
			 (json_int_t)sync->missed);
}

static json_t *module_json(const struct controller *controller)
{
	const struct incise_stepper_controller *info = &controller->info;
	json_t *motors = json_array();
	char name[sizeof(info->name) + 1] = {0};
	int plan = !!(info->capabilities & INCISE_STEPPER_CAP_PLAN);

	memcpy(name, info->name, sizeof(info->name));
	for (uint32_t i = 0; i < info->n_motors; i++)
		json_array_append_new(motors, motor_json(controller, i));
	return json_pack("{so so s{sI sI sI sI sI sI sI} so sb sb so so}", "device",
			 json_text(controller->path), "name", json_text(name),
			 "self_test", "rate_max_steps_s", (json_int_t)info->rate_max,
			 "pulse_min_ns", (json_int_t)info->pulse_ns, "tick_min_ns",
			 (json_int_t)info->tick_min_ns, "edge_ns",
			 (json_int_t)info->edge_ns, "lateness_p99_ns",
			 (json_int_t)info->lateness_ns, "lateness_max_ns",
			 (json_int_t)info->lateness_max_ns, "resolution_ns",
			 (json_int_t)info->resolution_ns, "sync", sync_json(controller),
			 "fixed_point", plan, "plan", plan, "motors", motors,
			 "no_evidence",
			 controller->no_debugfs ? json_string(controller->no_debugfs)
						: json_null());
}

void stepper_module_show(const char *what, bool json)
{
	json_t *controllers = json_array();
	struct controller controller;
	glob_t found = {0};
	bool all = !strcmp(what, "stepper");

	if (all && glob(DEVICES, 0, NULL, &found))
		cli_fail("there is no " DEVICES ": name the lines of a controller in "
			 "/etc/incise/stepper.conf and run 'systemctl start "
			 "incise-stepper'");
	for (size_t i = 0; i < (all ? found.gl_pathc : 1); i++) {
		read_controller(&controller, all ? found.gl_pathv[i] : what);
		if (json)
			json_array_append_new(controllers, module_json(&controller));
		else
			put_module_text(&controller);
	}
	if (json)
		json_print(json_pack("{ss sO}", "kind", "stepper", "controllers",
				     controllers));
	json_decref(controllers);
	if (all)
		globfree(&found);
}
