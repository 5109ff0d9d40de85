// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/daq/iio_source.c on a converter that a test makes: what is set
 * and put back, and each refusal. The linker hands open() of a device's file to here.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <fcntl.h>
#include <math.h>
#include <sys/stat.h>
#include <unistd.h>
#include "../../../lib/device/daq/iio_source.h"
#include "converter.h"

static int open_error;
static char folder[64];

int __real_open(const char *path, int flags, ...);

int __wrap_open(const char *path, int flags, ...)
{
	if (strcmp(path, "/dev/null") != 0 || !open_error)
		return __real_open(path, flags, 0);
	errno = open_error;
	return -1;
}

static int setup(void **state)
{
	world_reset();
	open_error = 0;
	snprintf(folder, sizeof(folder), "/nonexistent");
	return 0;
}

static struct iio_device *adc(void)
{
	return &world.devices[0];
}

static struct iio_channel *voltage(void)
{
	return &adc()->channels[1];
}

static int open_source(struct iio_source *s, const char *name, double rate_hz,
		       const char *trigger, struct incise_error *err)
{
	*s = (struct iio_source){
		.where = "rig.conf:3: force", .fd = -1, .trigger_folder = folder};
	s->setup.rate_hz = rate_hz;
	snprintf(s->setup.trigger, sizeof(s->setup.trigger), "%s", trigger);
	return iio_source_open(s, name, err);
}

static const char *text(const char *key)
{
	return device_attribute(adc(), key)->text;
}

static void is_set_up(void **state)
{
	struct incise_error err = {0};
	struct iio_source s;

	/* as Linux 6.1 answers */
	device_attribute(adc(), "current_timestamp_clock")->line = true;
	assert_int_equal(open_source(&s, "adc", 10000, "", &err), 0);
	assert_string_equal(text("current_timestamp_clock"), "monotonic");
	assert_string_equal(text("sampling_frequency"), "10000");
	assert_string_equal(text("trigger/current_trigger"), "own");
	assert_string_equal(s.trigger_used, "own");
	assert_true(s.rate_hz == 10000);
	assert_true(fabs(s.full_scale_V - 5) < 1e-12);
	assert_true(fabs(s.offset_V + 2.5) < 1e-12);
	iio_source_close(&s);
	assert_int_equal(world.made, 0);
}

static void named_trigger(void **state)
{
	struct incise_error err = {0};
	struct iio_source s;

	device_attribute(adc(), "sampling_frequency")->stuck = true;
	snprintf(device_attribute(adc(), "sampling_frequency")->text, 64, "20000");
	assert_int_equal(open_source(&s, "null", 1234.5, "timer", &err), 0);
	assert_string_equal(text("trigger/current_trigger"), "timer");
	assert_string_equal(
		device_attribute(&world.devices[2], "sampling_frequency")->text,
		"1234.500");
	assert_true(s.rate_hz == 1234.5);
	iio_source_close(&s);
	assert_string_equal(text("trigger/current_trigger"), "own");
}

/* Where there is a folder for them, one is made, and goes again. */
static void own_trigger(void **state)
{
	struct incise_error err = {0};
	char made[100];
	struct iio_source s;

	snprintf(folder, sizeof(folder), "/tmp/incise-test-XXXXXX");
	assert_non_null(mkdtemp(folder));
	snprintf(made, sizeof(made), "%s/incise-%ld-0", folder, (long)getpid());
	/* the kernel shows it at once; one that it does not take is put away */
	world.devices[2].name = strrchr(made, '/') + 1;
	assert_int_equal(open_source(&s, "adc", 10000, "", &err), 0);
	assert_int_equal(access(made, F_OK), 0);
	assert_string_equal(text("trigger/current_trigger"), world.devices[2].name);
	iio_source_close(&s);
	assert_int_equal(access(made, F_OK), -1);
	assert_string_equal(text("trigger/current_trigger"), "own");
	device_attribute(adc(), "trigger/current_trigger")->error = EINVAL;
	assert_int_equal(open_source(&s, "adc", 10000, "", &err), 0);
	assert_int_equal(access(made, F_OK), -1);
	assert_string_equal(s.trigger_used, "own");
	iio_source_close(&s);
	assert_int_equal(rmdir(folder), 0);
}

/* Configfs is root's. */
static void no_right_to_a_trigger(void **state)
{
	struct incise_error err = {0};
	bool root = !geteuid();
	struct iio_source s;

	snprintf(folder, sizeof(folder), "/");
	snprintf(device_attribute(adc(), "trigger/current_trigger")->text, 2, "%s", "");
	if (root && seteuid(65534))
		fail_msg("cannot become another user");
	assert_int_equal(open_source(&s, "adc", 10000, "", &err), -EACCES);
	iio_source_close(&s);
	if (root)
		assert_int_equal(seteuid(0), 0);
	assert_non_null(strstr(err.text, "as root: mkdir //incise"));
}

static void volts(void **state)
{
	static const struct {
		const char *scale, *offset;
		bool is_signed, known;
		double full_scale_V, offset_V;
	} cases[] = {
		{"1.220703125", "-2048", false, true, 5, -2.5},
		{"0.5", NULL, false, true, 2.048, 0},
		{"0.5", NULL, true, true, 2.048, -1.024},
		{"0.5", "100", true, true, 2.048, -0.974},
		{NULL, "3", false, false, 0, 0},
		{"0", NULL, false, false, 0, 0},
		{"-1", NULL, false, false, 0, 0},
		{"nan", NULL, false, false, 0, 0},
		{"x", NULL, false, false, 0, 0},
		{"1", "inf", false, true, 4.096, 0},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct iio_format format = {.bytes = 2, .bits = 12};
		struct iio_channel c = {0};
		double full_scale_V = 0, offset_V = 0;
		int n = 0;

		format.is_signed = cases[i].is_signed;
		if (cases[i].scale) {
			c.attributes[n].key = "scale";
			snprintf(c.attributes[n++].text, 64, "%s", cases[i].scale);
		}
		if (cases[i].offset) {
			c.attributes[n].key = "offset";
			snprintf(c.attributes[n++].text, 64, "%s", cases[i].offset);
		}
		assert_int_equal(iio_source_volts(&c, &format, &full_scale_V, &offset_V),
				 cases[i].known);
		assert_true(fabs(full_scale_V - cases[i].full_scale_V) < 1e-12);
		assert_true(fabs(offset_V - cases[i].offset_V) < 1e-12);
	}
}

/* Without a scale the set-up's is taken; a rate may be the channel's. */
static void what_the_driver_does_not_say(void **state)
{
	struct incise_error err = {0};
	struct iio_source s = {.where = "rig.conf:3: force",
			       .fd = -1,
			       .trigger_folder = folder,
			       .setup = {.rate_hz = 10000, .full_scale_V = 3.3}};

	voltage()->attributes[0].key = "sampling_frequency";
	adc()->attributes[2].key = "else";
	voltage()->format.is_signed = true;
	assert_int_equal(iio_source_open(&s, "adc", &err), 0);
	assert_true(s.full_scale_V == 3.3);
	assert_true(s.offset_V == -1.65);
	assert_string_equal(voltage()->attributes[0].text, "10000");
	iio_source_close(&s);
}

static void channels(void **state)
{
	static const struct {
		const char *id;
		int channel;
		bool found;
	} cases[] = {{"voltage1", 1, true},	     {"voltage1", 0, false},
		     {"voltage1-voltage2", 1, true}, {"voltage10", 1, false},
		     {"voltage10", 10, true},	     {"current1", 1, false}};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		voltage()->id = cases[i].id;
		assert_ptr_equal(iio_source_voltage(adc(), cases[i].channel),
				 cases[i].found ? voltage() : NULL);
	}
}

static void broken(int what)
{
	struct attribute *a = adc()->attributes;

	switch (what) {
	case 1:
		world.error = ENOSYS;
		break;
	case 2:
		open_error = EBUSY;
		break;
	case 3:
		open_error = EACCES;
		break;
	case 4:
		voltage()->no_scan = true;
		break;
	case 5:
		adc()->n_channels = 2;
		break;
	case 6:
		voltage()->format.bits = 32;
		voltage()->format.length = 32;
		break;
	case 7:
		voltage()->attributes[0].key = "else";
		break;
	case 8:
		a[0].stuck = true;
		break;
	case 9:
		a[0].error = EACCES;
		break;
	case 10:
		a[1].text[0] = '\0';
		break;
	case 11:
		a[2].key = "else";
		break;
	case 12:
		a[2].stuck = true;
		a[3] = (struct attribute){.key = "sampling_frequency_available",
					  .text = "1000 2000"};
		break;
	case 13:
		a[2].error = EACCES;
		break;
	case 14:
		a[1].error = EINVAL;
		break;
	case 15:
		a[2].error = EINVAL;
		break;
	}
}

static void refusals(void **state)
{
	static const struct {
		int what;
		const char *name, *trigger;
		int code;
		const char *says;
	} cases[] = {
		{1, "adc", "", ENOSYS, "load the driver of your converter"},
		{0, "other", "", ENODEV,
		 "there is no IIO device \"other\"; there are: adc (null)"},
		{0, "timer", "", ENODEV, "there is no IIO device \"timer\""},
		{2, "adc", "", EBUSY, "null is in use by another program"},
		{3, "adc", "", EACCES, "may not open the file of null; join the group"},
		{4, "adc", "", ENODEV, "has no voltage0 that a buffer can have"},
		{5, "adc", "", EOPNOTSUPP, "has no time stamps"},
		{6, "adc", "", EOPNOTSUPP, "samples of null are 32 bits of 32"},
		{7, "adc", "", EINVAL, "set force_setup.full_scale_V"},
		{8, "adc", "", EOPNOTSUPP, "stay on the clock \"realtime\""},
		{9, "adc", "", EACCES, "may not set the clock of time stamps of null"},
		{10, "adc", "", ENODEV, "nothing starts the conversions"},
		{0, "adc", "none", ENODEV,
		 "there is no trigger \"none\"; there are: own (trigger0), timer"},
		{0, "adc", "adc", ENODEV, "there is no trigger \"adc\""},
		{14, "adc", "timer", EINVAL, "does not take the trigger \"timer\""},
		{11, "adc", "", EOPNOTSUPP, "neither null nor its trigger has a rate"},
		{12, "adc", "", EINVAL,
		 "does not take 10000 Hz and runs at 1000 Hz; set "
		 "force_setup.rate_hz (available: 1000 2000)"},
		{13, "adc", "", EACCES, "may not set the rate of null"},
		{15, "adc", "", EINVAL, "does not take 10000 Hz: Invalid argument"},
		{12, "adc", "timer", EINVAL,
		 "null converts at 1000 Hz, its trigger at 10000 Hz"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_error err = {0};
		struct iio_source s;

		setup(NULL);
		broken(cases[i].what);
		assert_int_equal(open_source(&s, cases[i].name, 10000, cases[i].trigger,
					     &err),
				 -cases[i].code);
		if (!strstr(err.text, cases[i].says) ||
		    strncmp(err.text, "rig.conf:3: force: ", 19) != 0)
			fail_msg("case %zu: %s", i, err.text);
		iio_source_close(&s);
		assert_int_equal(world.made, 0);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup(is_set_up, setup),
		cmocka_unit_test_setup(named_trigger, setup),
		cmocka_unit_test_setup(own_trigger, setup),
		cmocka_unit_test_setup(no_right_to_a_trigger, setup),
		cmocka_unit_test_setup(volts, setup),
		cmocka_unit_test_setup(what_the_driver_does_not_say, setup),
		cmocka_unit_test_setup(channels, setup),
		cmocka_unit_test_setup(refusals, setup),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
