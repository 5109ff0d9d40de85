// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A controller of the kernel module, read; see stepper_module.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <libgen.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>
#include "../cli/cli.h"
#include "stepper_module.h"

#define DEBUGFS "/sys/kernel/debug/incise_stepper"
#define TRIES 1000

/* A slot that the kernel may be writing, whole. */
static int read_slot(const volatile struct incise_stepper_motor_status *slot,
		     struct incise_stepper_motor_status *status)
{
	for (int i = 0; i < TRIES; i++) {
		uint32_t before = __atomic_load_n(&slot->seq, __ATOMIC_ACQUIRE);

		memcpy(status, (const void *)slot, sizeof(*status));
		__atomic_thread_fence(__ATOMIC_ACQUIRE);
		if (!(before & 1) && before == slot->seq)
			return 0;
	}
	return -EAGAIN;
}

static void read_status(struct stepper_module *module, int fd)
{
	size_t size = (size_t)sysconf(_SC_PAGESIZE);
	void *page = mmap(NULL, size, PROT_READ, MAP_SHARED, fd,
			  (off_t)(INCISE_STEPPER_PAGE_STATUS * size));
	struct incise_stepper_motor_status *slots = page;

	if (page == MAP_FAILED)
		cli_fail("%s: mapping its status: %s", module->path, strerror(errno));
	for (uint32_t i = 0; i < module->info.n_motors; i++)
		if (read_slot(&slots[i], &module->motor[i].status))
			cli_fail(
				"%s: the status of motor %u changed each time it was read; "
				"try again",
				module->path, i);
	munmap(page, size);
}

/* Words of the rest of a line as numbers, one per motor. */
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

static FILE *open_evidence(const struct stepper_module *module, const char *file)
{
	char real[PATH_MAX], path[PATH_MAX + 100];

	/* A link that udev made has another name. */
	if (!realpath(module->path, real))
		return NULL;
	snprintf(path, sizeof(path), DEBUGFS "/%s/%s", basename(real), file);
	return fopen(path, "re");
}

/*
 * "from_us motor0 motor1 …", then a line per bin, "mean_ns …" and "max_ns …".
 * @cost: which of a motor's two
 */
static bool read_histogram(struct stepper_module *module, const char *file, bool cost)
{
	FILE *stream = open_evidence(module, file);
	uint64_t value[INCISE_STEPPER_MOTORS_MAX];
	uint32_t n = module->info.n_motors;
	char line[400];
	int bins = 0;
	bool ok = stream && fgets(line, sizeof(line), stream);

	while (ok && fgets(line, sizeof(line), stream)) {
		char *rest = line + strcspn(line, " ");
		bool mean = !strncmp(line, "mean_ns ", 8);
		bool max = !strncmp(line, "max_ns ", 7);

		ok = numbers(rest, value, n) &&
		     (mean || max || bins < STEPPER_MODULE_BINS);
		for (uint32_t i = 0; ok && i < n; i++) {
			struct stepper_motor *motor = &module->motor[i];
			struct stepper_histogram *h =
				cost ? &motor->cost : &motor->lateness;

			*(mean	? &h->mean_ns
			  : max ? &h->max_ns
				: &h->count[bins]) = value[i];
		}
		if (ok && !mean && !max)
			module->from_us[bins++] = (uint32_t)strtoul(line, NULL, 10);
	}
	if (stream)
		fclose(stream);
	module->bins = bins;
	return ok && bins;
}

/* Of "motor=0 edges=7 …" only what the status page does not have. */
static bool read_counters(struct stepper_module *module)
{
	FILE *stream = open_evidence(module, "counters");
	char line[400];
	uint32_t motor;
	uint64_t edges;

	while (stream && fgets(line, sizeof(line), stream))
		if (sscanf(line, "motor=%" SCNu32 " edges=%" SCNu64, &motor, &edges) ==
			    2 &&
		    motor < module->info.n_motors)
			module->motor[motor].edges = edges;
	if (stream)
		fclose(stream);
	return stream;
}

static void read_evidence(struct stepper_module *module)
{
	module->has_evidence = read_counters(module) &&
			       read_histogram(module, "lateness", false) &&
			       read_histogram(module, "cost", true);
	if (module->has_evidence)
		return;
	module->evidence = geteuid() ? "debugfs is for root"
				     : "there is no " DEBUGFS "; is debugfs mounted?";
}

static void ask(struct stepper_module *module, int fd, unsigned long what, void *answer)
{
	if (!ioctl(fd, what, answer))
		return;
	close(fd);
	if (errno == ENOTTY || errno == EINVAL)
		cli_fail("%s: this is no controller of incise_stepper, or one of another "
			 "version",
			 module->path);
	cli_fail("%s: %s", module->path, strerror(errno));
}

void stepper_module_read(struct stepper_module *module, const char *path)
{
	int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);

	*module = (struct stepper_module){.path = path};
	if (fd < 0 && errno == EACCES)
		cli_fail("%s: %s; join the group incise, or be root", path,
			 strerror(errno));
	if (fd < 0)
		cli_fail("%s: %s; incise info stepper shows those there are", path,
			 strerror(errno));
	ask(module, fd, INCISE_STEPPER_GET_INFO, &module->info);
	if (module->info.n_motors > INCISE_STEPPER_MOTORS_MAX)
		cli_fail("%s: it says it has %u motors: another version", path,
			 module->info.n_motors);
	for (uint32_t i = 0; i < module->info.n_motors; i++) {
		module->motor[i].config.motor = i;
		ask(module, fd, INCISE_STEPPER_GET_CONFIG, &module->motor[i].config);
	}
	module->has_sync = module->info.capabilities & INCISE_STEPPER_CAP_SYNC;
	if (module->has_sync)
		ask(module, fd, INCISE_STEPPER_GET_SYNC, &module->sync);
	read_status(module, fd);
	read_evidence(module);
	close(fd);
}
