// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/daq/iio_force.c on a converter that a test simulates: missing samples by their timestamps, a
 * channel that cannot be opened, the search. A channel that samples needs a kernel:
 * tests/vm/guest/force_iio.c.
 */
#include "../unit.h"
#include <dirent.h>
#include "../../../lib/device/daq/iio_force.c"
#include "../message.h"
#include "converter.h"
#include "found.h"

/* --- spacing --- */

#define T 100000 /* ns */
#define START 5000000000LL

static struct daq_feed *feed;
static struct spacing spacing;

static int spacing_setup(void **state)
{
	feed = aligned_alloc(_Alignof(struct daq_feed), sizeof(*feed));
	memset(feed, 0, sizeof(*feed));
	feed->info.bits = 12;
	feed->info.rate_hz = 10000;
	spacing_init(&spacing, feed, 10000);
	return daq_feed_init(feed);
}

static int teardown(void **state)
{
	daq_feed_free(feed);
	free(feed);
	return 0;
}

/* The code says which conversion it was. */
static void put(int64_t n, int64_t late_ns)
{
	spacing_put(&spacing, START + n * T + late_ns, (int32_t)(n & 4095));
}

/* All that came have the number of their conversion. */
static void numbers_are_right(void)
{
	struct incise_force_sample sample;

	spacing_flush(&spacing);
	while (daq_feed_read(&feed->force, &sample, 1) == 1)
		assert_int_equal(sample.code, sample.seq & 4095);
}

TEST(gaps, spacing_setup, teardown)
{
	static const int lengths[] = {1, 2, 3, 10, 1000, 19999, 1000000};
	uint64_t lost = 0, overflows = 0;
	struct incise_force_info info;
	int64_t n = 0;

	for (size_t i = 0; i < sizeof(lengths) / sizeof(*lengths); i++) {
		for (int k = 0; k < 100; k++)
			put(n++, 0);
		n += lengths[i];
		lost += (uint64_t)lengths[i];
		overflows++;
	}
	put(n, 0);
	put(n + 1, 0);
	numbers_are_right();
	daq_feed_info(&feed->force, &info);
	assert_int_equal(daq_feed_lost(&feed->force), lost);
	assert_int_equal(info.overflows, overflows);
}

/* Up to just below a period late: distinguished from a loss by what follows. */
TEST(lateness_is_no_gap, spacing_setup, teardown)
{
	for (int64_t n = 0; n < 20000; n++)
		put(n, n % 7 == 3 ? (n % 100) * T / 101 : 0);
	numbers_are_right();
	assert_int_equal(daq_feed_lost(&feed->force), 0);
}

/* And a loss is one, when the sample behind it is late, too. */
TEST(late_behind_a_gap, spacing_setup, teardown)
{
	int64_t n = 0;

	for (int i = 0; i < 1000; i++) {
		put(n++, 0);
		put(n++, 0);
		n += i % 5;
		put(n++, (i % 97) * T / 100);
	}
	numbers_are_right();
	assert_int_equal(daq_feed_lost(&feed->force), 2000);
}

/* An oscillator that is 1 % off: after it has been seen, long gaps are right, too. */
TEST(clock_is_off, spacing_setup, teardown)
{
	static const double factors[] = {0.99, 1.01};

	for (size_t i = 0; i < 2; i++) {
		int64_t n = 0;

		teardown(NULL);
		spacing_setup(NULL);
		for (; n < 30000; n++)
			put(n, llround((double)(n * T) * (factors[i] - 1)));
		n += 5000;
		for (int k = 0; k < 100; k++, n++)
			put(n, llround((double)(n * T) * (factors[i] - 1)));
		numbers_are_right();
		assert_int_equal(daq_feed_lost(&feed->force), 5000);
	}
}

/* Nothing is computed beyond what numbers hold, and no sample is left out. */
TEST(nonsense, spacing_setup, teardown)
{
	static const int64_t timestamps[] = {
		0, INT64_MAX, INT64_MIN, -1, 1, INT64_MAX / 2, 0, 5, 5, 3};
	struct incise_force_sample sample;
	uint64_t last = 0;
	int n = 0, total = 0;

	for (int round = 0; round < 200; round++)
		for (size_t i = 0; i < sizeof(timestamps) / sizeof(*timestamps);
		     i++, total++)
			spacing_put(&spacing, timestamps[(i * 7 + (size_t)round) % 10],
				    1);
	spacing_flush(&spacing);
	while (daq_feed_read(&feed->force, &sample, 1) == 1) {
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
