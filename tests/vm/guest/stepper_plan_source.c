// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A plan whose positions come from a channel of the IIO subsystem, inside the kernel: no program is
 * in the loop, and one that is stopped or holds nothing but the file changes nothing.
 *
 *   stepper_plan_source HZ TICK_NS
 *
 * Rates are asserted in virtual time only.
 */
#include <errno.h>
#include <glob.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>

#include "../../../lib/fixed/layout.h"
#include "../hold.h"
#include "../plan_feed.h"
#include "../tap.h"

#define DEADMAN_NS 5000000000
#define LONG 60000000000
#define SAMPLES 2000

static struct bench bench;
static struct incise_fixed_plan_header *head;
static uint32_t size;
static bool virtual_time;

/* A file of the simulated converter in sysfs. */
static bool put(const char *name, const char *text)
{
	char pattern[160], its[64] = "";
	bool good = false;
	glob_t found;
	FILE *file;

	glob("/sys/bus/iio/devices/iio:device*", 0, NULL, &found);
	for (size_t i = 0; i < found.gl_pathc && !good; i++) {
		snprintf(pattern, sizeof(pattern), "%s/name", found.gl_pathv[i]);
		file = fopen(pattern, "r");
		if (!file)
			continue;
		if (fscanf(file, "%63s", its) != 1)
			its[0] = '\0';
		fclose(file);
		if (strcmp(its, INCISE_SIM_ADC))
			continue;
		snprintf(pattern, sizeof(pattern), "%s/%s", found.gl_pathv[i], name);
		file = fopen(pattern, "w");
		good = file && fputs(text, file) >= 0;
		if (file)
			good = !fclose(file) && good;
	}
	globfree(&found);
	return good;
}

/* From 5 mm outside to 3 mm in the tissue and back, at 10 mm for 4096. */
static bool waveform(void)
{
	static uint16_t sample[SAMPLES];

	for (int i = 0; i < SAMPLES; i++)
		sample[i] = (uint16_t)((i < SAMPLES / 2 ? i : SAMPLES - i) * 3277 /
				       (SAMPLES / 2));
	return simulator_write_bytes("adc/waveform", sample, sizeof(sample)) >= 0;
}

static int load(void)
{
	struct incise_stepper_plan plan = {
		.motors = 1,
		.flags = INCISE_STEPPER_PLAN_SOURCE,
		.data = (uintptr_t)head,
		.size = size,
		.origin = {0, 0, 55 << 16},
		.direction = {0, 0, -(1 << 30)},
		.scale = (10LL << 32) / 4096,
		.quaternion = {1 << 30},
		.tool = INCISE_TOOL_BLADE,
	};

	return ioctl(bench.fd, INCISE_STEPPER_LOAD_PLAN, &plan) ? -errno : 0;
}

/* Mode POSE, once. */
static void follow(uint32_t tool)
{
	plan_pose(&bench, 0, &(struct incise_fixed_pose){.tool = tool});
}

static void runs(int hz, int tick_ns)
{
	const int64_t rate = hz < 1000000000 / tick_ns ? hz : 1000000000 / tick_ns;
	struct incise_stepper_plan_status before, after;
	int32_t most = 0;

	before = plan_look(&bench);
	hold_ms(1000);
	after = plan_look(&bench);
	note("%d Hz, tick %d us: %llu poses in %llu ticks, %llu missed; age %lld us", hz,
	     tick_ns / 1000, (unsigned long long)(after.poses - before.poses),
	     (unsigned long long)(after.ticks - before.ticks),
	     (unsigned long long)(after.missed - before.missed),
	     (long long)after.age_ns / 1000);
	check(after.poses > before.poses && after.ticks > before.ticks,
	      "a program that is stopped for a second changes nothing");
	if (virtual_time) {
		/*
		 * The timers of both are independent, and a tick takes the newest sample. At equal
		 * rates their phases may meet: a jitter of a microsecond then puts two samples between
		 * two ticks and none between the next two, at worst each time.
		 */
		check((int64_t)(after.poses - before.poses) >=
			      (hz > rate ? rate * 99 / 100 : rate * 49 / 100),
		      "poses are taken at %lld Hz", (long long)rate);
		check(!after.missed && !after.refused,
		      "no tick is missed, no pose refused");
	}
	for (int i = 0; i < 1000; i++) {
		int32_t force = plan_look(&bench).command[2];

		most = force > most ? force : most;
		bench_nap(1000000);
	}
	note("a force of %.3f N at most", most / 65536.0);
	/* 3 mm at 0.5 N/mm, but for what the filter is behind. */
	check(most > 65536, "it is felt");
	check(bench_look(&bench, 0).steps_up > 0, "and moves the motor");
}

static void stops(const char *hz)
{
	put("sampling_frequency", "1");
	bench_nap(400000000);
	check(plan_look(&bench).reasons & INCISE_STEPPER_PLAN_SILENT &&
		      !plan_look(&bench).command[2],
	      "without samples the force fades");
	check(!bench_look(&bench, 0).faults, "that is no fault before the deadman");
	put("sampling_frequency", hz);
	check(plan_until(&bench, INCISE_STEPPER_PLAN_FELT, LONG),
	      "it comes back with them");
	follow(INCISE_STEPPER_POSE_FADE);
	bench_nap(200000000);
	check(plan_look(&bench).state == INCISE_STEPPER_PLAN_FADE &&
		      plan_look(&bench).reasons & INCISE_STEPPER_PLAN_ASKED,
	      "the page can let the force go");
	follow(0);
	check(plan_until(&bench, INCISE_STEPPER_PLAN_FELT, LONG), "and let it come");
	check(module_unload("incise_source") < 0, "the source stays while it is open");
}

int main(int argc, char **argv)
{
	const char *hz = argc > 1 ? argv[1] : "4000";
	const int tick_ns = argc > 2 ? atoi(argv[2]) : 1000000;
	const struct plan_recipe recipe = {"source", INCISE_FIXED_PLANE, 1, tick_ns,
					   .plain = true};
	const char *profile = getenv("INCISE_VM_PROFILE");
	struct incise_stepper_config config;
	uint32_t motor_ns;
	int ret;

	virtual_time = profile && !strcmp(profile, "deterministic");
	head = plan_make(&recipe, &size);
	ret = bench_bind(&bench, 1);
	ret = ret ? ret : bench_open(&bench);
	if (!check(head && !ret, "a motor is bound (%s)", strerror(-ret)))
		return 1;
	/* A filter of that rate, which says where the sensor is, not where it was. */
	head->numbers.filter.period_ns = 1000000000 / atoi(hz);
	head->numbers.filter.latency_ns = 0;
	head->crc = incise_fx_crc((const uint8_t *)head + INCISE_FIXED_PLAN_CRC_FROM,
				  size - INCISE_FIXED_PLAN_CRC_FROM);
	check(put("current_timestamp_clock", "monotonic\n") &&
		      put("sampling_frequency", hz) && waveform(),
	      "a converter of %s Hz", hz);
	/* Ten a tick of 1 kHz, where the machine is fast enough. */
	motor_ns = bench.info.tick_min_ns > 100000 ? bench.info.tick_min_ns : 100000;
	config = plan_config(&bench, 0, motor_ns, DEADMAN_NS);
	ret = bench_configure(&bench, &config, 750);
	ret = ret ? ret : load();
	ret = ret ? ret : bench_command(&bench, INCISE_STEPPER_ENABLE, 1);
	follow(0);
	if (check(!ret && plan_until(&bench, INCISE_STEPPER_PLAN_FELT, LONG),
		  "its plan has a source (%s)", strerror(-ret))) {
		runs(atoi(hz), tick_ns);
		stops(hz);
	}
	bench_command(&bench, INCISE_STEPPER_DISABLE, 1);
	bench_close(&bench);
	check(!bench_unbind(&bench), "it is unbound");
	simulator_write("adc/control", "clear");
	return tap_failures != 0;
}
