// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/daq/iio_force.c on a converter that a test simulates: missing samples by their timestamps, a
 * channel that cannot be opened, the search. A channel that samples needs a kernel:
 * tests/vm/guest/force_iio.c.
 */
#include "../unit.h"
#include <dirent.h>
#include "../../../lib/device/daq/iio_force.c"
#include "converter.h"
#include "found.h"

/* --- losses and times --- */

#define T 100000 /* ns */
#define START 5000000000LL
#define SAMPLES 40000

static struct iio_force *channel;

static int channel_setup(void **state)
{
	channel = aligned_alloc(_Alignof(struct iio_force), sizeof(*channel));
	memset(channel, 0, sizeof(*channel));
	channel->feed.info.bits = 20;
	channel->feed.info.rate_hz = 10000;
	incise_pace_init(&channel->pace, 10000, INCISE_PACE_OFF, 1);
	return daq_feed_init(&channel->feed);
}

static int teardown(void **state)
{
	daq_feed_free(&channel->feed);
	free(channel);
	return 0;
}

/* The code says which conversion it was. */
static void take(int n, int64_t t_ns)
{
	take_iio_force(channel, t_ns, n + 1, t_ns);
}

struct source {
	const char *name;
	int fifo;		 /* samples in a block, at its end */
	int64_t apart_ns;	 /* as they are read out of it */
	double jitter_T, factor; /* of the clock */
	int every, missing;	 /* of so many the last ones */
	double wrong_T;		 /* times, behind the first blocks */
};

/* Each is a source of a public report: what it loses is exact, and its times are right. */
TEST(losses_and_times)
{
	static const struct source sources[] = {
		{"exact", 1, 0, 0, 1, 0, 0, 1e-4},
		{"late by less than a period", 1, 0, 0.9, 1, 0, 0, 1},
		{"overruns", 1, 0, 0.1, 1, 10000, 5, 0.1},
		{"one of each 8000", 1, 0, 0.1, 1, 8000, 1, 0.1},
		{"a clock that is off by 1 %", 1, 0, 0, 1.01, 10000, 5000, 1e-4},
		{"a FIFO of 8", 8, 0, 0, 1, 0, 0, 0.01},
		{"a FIFO of 32", 32, 0, 0, 1, 0, 0, 0.01},
		{"a FIFO that is read in 1 us each", 32, 1000, 0, 1, 0, 0, 0.4},
		{"blocks of a FIFO are lost", 32, 0, 0, 1, 6400, 64, 0.01},
	};

	for (size_t k = 0; k < sizeof(sources) / sizeof(*sources); k++) {
		const struct source *s = &sources[k];
		struct incise_force_sample sample;
		uint64_t missing = 0;
		int n = 0;

		channel_setup(NULL);
		srand(1);
		for (int i = 0; i < SAMPLES; i++) {
			int last = i / s->fifo * s->fifo + s->fifo - 1;
			double due_T = last + s->jitter_T * rand() / RAND_MAX;

			/* Those at the end nothing shows. */
			if (s->every && i < SAMPLES - s->every &&
			    i % s->every >= s->every - s->missing)
				missing++;
			else
				take(i, START + llround(due_T * s->factor * T) -
						(last - i) * s->apart_ns);
		}
		if (daq_feed_lost(&channel->feed.force) != missing)
			fail_msg("%s: %d lost, not %d", s->name,
				 (int)daq_feed_lost(&channel->feed.force), (int)missing);
		while (daq_feed_read(&channel->feed.force, &sample, 1) == 1) {
			double due_ns = (sample.code - 1) * s->factor * T;
			double wrong_T = fabs((double)(sample.t_ns - START) - due_ns) / T;

			if (n++ >= 2 * s->fifo && wrong_T > s->wrong_T + 1e-9)
				fail_msg("%s: sample %d is %.3f periods wrong", s->name,
					 sample.code - 1, wrong_T);
		}
		assert_int_equal((uint64_t)n + missing, SAMPLES);
		teardown(NULL);
	}
}

/* Nothing is computed beyond what numbers hold, and no sample is left out. */
TEST(nonsense, channel_setup, teardown)
{
	static const int64_t timestamps[] = {
		0, INT64_MAX, INT64_MIN, -1, 1, INT64_MAX / 2, 0, 5, 5, 3};
	struct incise_force_sample sample;
	uint64_t last = 0;
	int n = 0, total = 0;

	for (int round = 0; round < 200; round++)
		for (size_t i = 0; i < sizeof(timestamps) / sizeof(*timestamps);
		     i++, total++)
			take_iio_force(channel, timestamps[(i * 7 + (size_t)round) % 10],
				       1, 0);
	while (daq_feed_read(&channel->feed.force, &sample, 1) == 1) {
		assert_true(!n || sample.seq > last);
		last = sample.seq;
		n++;
	}
	assert_int_equal(n, total);
}

/* --- iio_force --- */

static int setup(void **state)
{
	world_reset();
	return 0;
}

static int open_files(void)
{
	DIR *folder = opendir("/proc/self/fd");
	int n = 0;

	while (readdir(folder))
		n++;
	closedir(folder);
	return n;
}

TEST(refusals)
{
	static const struct {
		const char *arguments;
		double rate_hz;
		int code;
		const char *says;
	} cases[] = {
		{"", 10000, EINVAL, "iio:"},
		{"adc", 0, EINVAL, "force_setup"},
		{"adc", 1e9, EINVAL, "force_setup"},
		{"other", 10000, ENODEV, "\"other\""},
		/* set up wholly; then there is no such folder in sysfs to start it by */
		{"adc", 10000, ENOENT, "5000"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_force_setup asked = {.rate_hz = cases[i].rate_hz};
		struct incise_backend_request request = {
			.arguments = cases[i].arguments,
			.where = "rig.conf:3: force",
			.force = &asked,
		};
		int before = open_files();

		setup(NULL);
		assert_error(incise_force_iio.open(&request, &err), cases[i].code, &err,
			     "rig.conf:3: force: ", cases[i].says);
		assert_int_equal(world.made, 0);
		assert_int_equal(open_files(), before);
		/* What started conversions before does so again. */
		assert_string_equal(device_attribute(&world.devices[0],
						     "trigger/current_trigger")
					    ->text,
				    "own");
	}
}

/* --- scan --- */

static struct found found;

static int scan_setup(void **state)
{
	world_reset();
	found = (struct found){0};
	return 0;
}

static int scan(const char *arguments)
{
	int rc = incise_force_iio.scan(arguments, keep, &found, &err);

	/* The source leaves nothing open, with any result. */
	assert_int_equal(world.made, 0);
	return rc;
}

TEST(a_converter_is_told_of, scan_setup)
{
	const struct incise_scan_device *adc = &found.device[0];
	static const char *const properties[][2] = {
		{"id", "null"},		 {"name", "adc"},    {"channels", "1"},
		{"channel", "voltage0"}, {"bits", "12"},     {"range_V", "-2.5 to 2.5"},
		{"rate_hz", "1000"},	 {"trigger", "own"}, {"time_stamps", "kernel"},
	};

	assert_int_equal(scan(""), 0);
	/* Triggers are devices too, and none of these. */
	assert_int_equal(found.n, 1);
	assert_string_equal(adc->device, "iio:adc");
	assert_true(adc->usable);
	for (size_t i = 0; i < sizeof(properties) / sizeof(*properties); i++)
		assert_string_equal(property_of(adc, properties[i][0]), properties[i][1]);
}

TEST(two_of_a_name_go_by_number, scan_setup)
{
	world.devices[1] = world.devices[0];
	world.devices[1].id = "iio:device7";
	assert_int_equal(scan(""), 0);
	assert_int_equal(found.n, 2);
	assert_string_equal(found.device[0].device, "iio:null");
	assert_string_equal(found.device[1].device, "iio:iio:device7");
}

TEST(what_cannot_be_used_is_told_as_such, scan_setup)
{
	struct iio_device *adc = &world.devices[0];

	adc->channels[1].format.bits = 32; /* of incise_force_sample.code 31 are */
	assert_int_equal(scan(""), 0);
	assert_false(found.device[0].usable);
	assert_string_equal(property_of(&found.device[0], "range_V"), "");
	scan_setup(NULL);
	adc->channels[2].id = "voltage1";
	assert_int_equal(scan(""), 0);
	assert_false(found.device[0].usable);
	assert_string_equal(property_of(&found.device[0], "channels"), "2");
	assert_string_equal(property_of(&found.device[0], "time_stamps"), "none");
	/* Without a scale it is of use, once rig.conf says what the codes stand for. */
	scan_setup(NULL);
	adc->channels[1].attributes[0].key = "other";
	assert_int_equal(scan(""), 0);
	assert_true(found.device[0].usable);
	assert_string_equal(property_of(&found.device[0], "range_V"), "");
}

TEST(by_name_and_without_any, scan_setup)
{
	static const struct {
		const char *arguments;
		int n;
	} cases[] = {{"adc", 1}, {"null", 1}, {"other", 0}, {"own", 0}};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		scan_setup(NULL);
		assert_int_equal(scan(cases[i].arguments), 0);
		if (found.n != cases[i].n)
			fail_msg("%s: %d", cases[i].arguments, found.n);
	}
	scan_setup(NULL);
	world.error = ENOSYS; /* no IIO in this kernel */
	assert_int_equal(scan(""), 0);
	assert_int_equal(found.n, 0);
	scan_setup(NULL);
	world.devices[1] = world.devices[0];
	found.answer = -ENOMEM;
	assert_int_equal(scan(""), -ENOMEM);
	assert_int_equal(found.n, 1);
}
