// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/daq/iio_source.c on a converter that a test simulates: formats, triggers in a folder that stands
 * for configfs, rates, set-up and its refusals, and the buffer on files that stand for a device.
 */
#include "../unit.h"
#include <fcntl.h>
#include <ftw.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include "../../../lib/device/daq/iio_source.c"
#include "converter.h"

/* --- format --- */

/* As the kernel writes it in scan_elements/in_voltage0_type: "le:s12/16>>4". */
static struct iio_data_format data_of(const char *type)
{
	struct iio_data_format data = {.repeat = 1};
	char endian, sign;

	if (sscanf(type, "%ce:%c%u/%uX%u>>%u", &endian, &sign, &data.bits, &data.length,
		   &data.repeat, &data.shift) != 6)
		assert_int_equal(sscanf(type, "%ce:%c%u/%u>>%u", &endian, &sign,
					&data.bits, &data.length, &data.shift),
				 5);
	data.is_be = endian == 'b';
	data.is_signed = sign == 's' || sign == 'S';
	return data;
}

/* Of the test that runs. */
static struct iio_source s;

TEST(codes)
{
	static const struct {
		const char *type;
		unsigned char bytes[8];
		uint64_t raw;
		int32_t code;
	} cases[] = {
		{"le:u8/8>>0", {0xa5}, 0xa5, 0xa5},
		{"le:s8/8>>0", {0x80}, 0x80, 0},
		{"le:s8/8>>0", {0x7f}, 0x7f, 255},
		{"le:u12/16>>0", {0x34, 0xf2}, 0x234, 0x234},
		{"be:u12/16>>0", {0xf2, 0x34}, 0x234, 0x234},
		{"le:u12/16>>4", {0x4f, 0x23}, 0x234, 0x234},
		{"be:u12/16>>4", {0x23, 0x4f}, 0x234, 0x234},
		{"le:s12/16>>0", {0x00, 0x08}, 0x800, 0},
		{"le:s12/16>>0", {0xff, 0x07}, 0x7ff, 4095},
		{"le:s12/16>>0", {0xff, 0xff}, 0xfff, 2047},
		{"be:s12/16>>4", {0x80, 0x00}, 0x800, 0},
		{"be:s12/16>>4", {0x00, 0x0f}, 0x000, 2048},
		{"le:S16/16>>0", {0x00, 0x80}, 0x8000, 0},
		{"be:u16/16>>0", {0xff, 0xff}, 0xffff, 65535},
		{"be:u24/32>>8", {0x12, 0x34, 0x56, 0xff}, 0x123456, 0x123456},
		{"be:s24/32>>8", {0x80, 0x00, 0x01, 0xff}, 0x800001, 1},
		{"le:s24/32>>0", {0xff, 0xff, 0x7f, 0x00}, 0x7fffff, 0xffffff},
		{"le:u31/32>>1", {0xff, 0xff, 0xff, 0xff}, 0x7fffffff, 0x7fffffff},
		{"le:s31/64>>33", {0, 0, 0, 0, 0, 0, 0, 0x80}, 0x40000000, 0},
		{"le:u1/8>>7", {0x80}, 1, 1},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct iio_data_format data = data_of(cases[i].type);
		struct iio_format format = {0};

		assert_int_equal(iio_format_of(&format, &data, 31), 0);
		assert_int_equal(raw_value(&format, cases[i].bytes), cases[i].raw);
		assert_int_equal(code_of(&format, cases[i].bytes), cases[i].code);
	}
}

TEST(timestamps)
{
	static const unsigned char le[8] = {8, 7, 6, 5, 4, 3, 2, 1};
	struct iio_data_format data = data_of("le:s64/64>>0");
	struct iio_format format = {0};

	assert_int_equal(iio_format_of(&format, &data, 64), 0);
	assert_int_equal(raw_value(&format, le), 0x0102030405060708);
	data = data_of("be:s64/64>>0");
	assert_int_equal(iio_format_of(&format, &data, 64), 0);
	assert_int_equal(raw_value(&format, le), 0x0807060504030201);
}

/* A signed code grows with the voltage, through all of its range. */
TEST(order)
{
	struct iio_data_format data = data_of("be:s10/16>>3");
	struct iio_format format = {0};

	assert_int_equal(iio_format_of(&format, &data, 31), 0);
	for (int volts = -512; volts < 512; volts++) {
		uint16_t stored = (uint16_t)((unsigned int)(volts & 0x3ff) << 3 | 5);
		unsigned char bytes[2] = {stored >> 8, stored & 0xff};

		assert_int_equal(code_of(&format, bytes), volts + 512);
	}
}

TEST(formats_refused)
{
	static const char *const types[] = {
		"le:u0/16>>0",	 "le:u12/12>>0",   "le:u17/16>>0",
		"le:u12/16>>5",	 "le:u32/32>>0",   "le:u12/24>>0",
		"le:u12/128>>0", "le:u12/16X2>>0", "le:u12/16>>4294967295",
	};

	for (size_t i = 0; i < sizeof(types) / sizeof(*types); i++) {
		struct iio_data_format data = data_of(types[i]);
		struct iio_format format = {0};

		assert_int_equal(iio_format_of(&format, &data, 31), -EINVAL);
	}
}

/* --- trigger --- */

static char trigger_folder[64];

static int trigger_setup(void **state)
{
	snprintf(trigger_folder, sizeof(trigger_folder), "/tmp/incise-test-XXXXXX");
	return mkdtemp(trigger_folder) ? 0 : -1;
}

/* Fails where anything is left. */
static int trigger_teardown(void **state)
{
	return rmdir(trigger_folder);
}

static bool there(const char *name)
{
	char path[200];

	snprintf(path, sizeof(path), "%s/%s", trigger_folder, name);
	return !access(path, F_OK);
}

static void make(const char *name)
{
	char path[200];

	snprintf(path, sizeof(path), "%s/%s", trigger_folder, name);
	assert_int_equal(mkdir(path, 0755), 0);
}

TEST(comes_and_goes, trigger_setup, trigger_teardown)
{
	char one[64], two[64], expected[64];

	assert_int_equal(make_trigger(trigger_folder, one, sizeof(one)), 0);
	assert_int_equal(make_trigger(trigger_folder, two, sizeof(two)), 0);
	snprintf(expected, sizeof(expected), "incise-%ld-0", (long)getpid());
	assert_string_equal(one, expected);
	snprintf(expected, sizeof(expected), "incise-%ld-1", (long)getpid());
	assert_string_equal(two, expected);
	/* this program lives: its own stay */
	sweep_triggers(trigger_folder);
	assert_true(there(one) && there(two));
	remove_trigger(trigger_folder, one);
	remove_trigger(trigger_folder, two);
	remove_trigger(trigger_folder, "");
	assert_false(there(one) || there(two));
}

TEST(kernel_without, trigger_setup, trigger_teardown)
{
	char name[64];

	assert_int_equal(make_trigger("/nonexistent", name, sizeof(name)), -ENOENT);
	assert_string_equal(name, "");
	sweep_triggers("/nonexistent");
}

TEST(too_many, trigger_setup, trigger_teardown)
{
	char names[17][64];
	int n = 0;

	while (n < 17 && !make_trigger(trigger_folder, names[n], sizeof(*names)))
		n++;
	assert_int_equal(n, 16);
	while (n--)
		remove_trigger(trigger_folder, names[n]);
}

/* Only those of the dead, and only what has the form of ours. */
TEST(sweep, trigger_setup, trigger_teardown)
{
	static const char *const others[] = {"timer",	   "incise-",	 "incise-1",
					     "incise-x-0", "incise-0-0", "incise--5-0",
					     "incise-1-0"};
	char dead[64], more[64];
	pid_t child = fork();

	if (!child)
		_exit(0);
	assert_int_equal(waitpid(child, NULL, 0), child);
	snprintf(dead, sizeof(dead), "incise-%ld-3", (long)child);
	snprintf(more, sizeof(more), "incise-%ld-3-x", (long)child);
	make(dead);
	make(more);
	for (size_t i = 0; i < sizeof(others) / sizeof(*others); i++)
		make(others[i]);
	sweep_triggers(trigger_folder);
	assert_false(there(dead));
	assert_true(there(more));
	remove_trigger(trigger_folder, more);
	for (size_t i = 0; i < sizeof(others) / sizeof(*others); i++) {
		assert_true(there(others[i]));
		remove_trigger(trigger_folder, others[i]);
	}
}

/* --- rate --- */

static struct iio_source source;

static struct attribute *own(void)
{
	return device_attribute(&world.devices[0], "sampling_frequency");
}

static struct attribute *timer(void)
{
	return device_attribute(&world.devices[2], "sampling_frequency");
}

static int rate_setup(void **state)
{
	world_reset();
	source = (struct iio_source){.where = "rig.conf:3: force",
				     .device = &world.devices[0],
				     .voltage = &world.devices[0].channels[1]};
	return 0;
}

static int set_to(double rate_hz, const struct iio_device *trigger,
		  struct incise_error *err)
{
	*err = (struct incise_error){0};
	source.setup.rate_hz = rate_hz;
	return set_rate(&source, trigger, err);
}

/* Whole numbers without a point: some drivers take no other. */
TEST(how_it_is_written, rate_setup)
{
	static const struct {
		double rate_hz;
		const char *text;
	} cases[] = {
		{1, "1"},
		{10000, "10000"},
		{1234.5, "1234.500"},
		{99999.9996, "100000"},
		{0.001, "0.001"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		rate_setup(NULL);
		assert_int_equal(set_to(cases[i].rate_hz, NULL, &err), 0);
		assert_string_equal(own()->text, cases[i].text);
	}
}

/* A trigger's before the device's, that before the channel's. */
TEST(where_it_is, rate_setup)
{
	assert_int_equal(set_to(5000, &world.devices[2], &err), 0);
	assert_string_equal(timer()->text, "5000");
	assert_string_equal(own()->text, "5000");
	assert_true(source.rate_hz == 5000);
	rate_setup(NULL);
	/* A trigger without one: the device makes the pace. */
	assert_int_equal(set_to(4000, &world.devices[1], &err), 0);
	assert_string_equal(own()->text, "4000");
	rate_setup(NULL);
	own()->key = "other";
	source.voltage->attributes[2] =
		(struct attribute){.key = "sampling_frequency", .text = "1"};
	assert_int_equal(set_to(3000, NULL, &err), 0);
	assert_string_equal(source.voltage->attributes[2].text, "3000");
	rate_setup(NULL);
	own()->key = "other";
	assert_error(set_to(3000, NULL, &err), EOPNOTSUPP, &err, "force_setup.trigger");
}

/* Converters divide a clock: within 1 % it is the rate that was asked for. */
TEST(how_far_off_it_may_be, rate_setup)
{
	static const struct {
		const char *is;
		bool taken;
	} cases[] = {
		{"10099", true}, {"9901", true}, {"10101", false},
		{"9899", false}, {"0", false},	 {"", false},
		{"nan", false},	 {"inf", false}, {"-10000", false},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		rate_setup(NULL);
		own()->stuck = true;
		strcpy(own()->text, cases[i].is);
		if (set_to(10000, NULL, &err) != (cases[i].taken ? 0 : -EINVAL))
			fail_msg("%s: %s", cases[i].is, err.text);
		if (!cases[i].taken)
			assert_says(err.text, "force_setup.rate_hz");
	}
	/* A converter that is slower than its trigger leaves some out. */
	rate_setup(NULL);
	own()->stuck = true;
	strcpy(own()->text, "9000");
	assert_error(set_to(10000, &world.devices[2], &err), EINVAL, &err, "9000 Hz",
		     "10000 Hz");
}

/* --- iio_source --- */

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

static struct iio_channel *the_voltage(void)
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

TEST(is_set_up, setup)
{
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

TEST(named_trigger, setup)
{
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
TEST(own_trigger, setup)
{
	char made[100];

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
TEST(no_right_to_a_trigger, setup)
{
	bool root = !geteuid();

	snprintf(folder, sizeof(folder), "/");
	snprintf(device_attribute(adc(), "trigger/current_trigger")->text, 2, "%s", "");
	if (root && seteuid(65534))
		fail_msg("cannot become another user");
	assert_int_equal(open_source(&s, "adc", 10000, "", &err), -EACCES);
	iio_source_close(&s);
	if (root)
		assert_int_equal(seteuid(0), 0);
	assert_says(err.text, "mkdir //incise");
}

TEST(volts, setup)
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

TEST(a_scale_that_is_changed, setup)
{
	struct attribute *scale = the_voltage()->attributes;

	assert_int_equal(open_source(&s, "adc", 10000, "", &err), 0);
	assert_false(iio_source_changed(&s));
	snprintf(scale->text, sizeof(scale->text), "0.3");
	assert_true(iio_source_changed(&s));
	scale->key = "else";
	assert_false(iio_source_changed(&s));
	iio_source_close(&s);
}

/* Without a scale the set-up's is taken; a rate may be the channel's. */
TEST(what_the_driver_does_not_say, setup)
{
	struct iio_source s = {.where = "rig.conf:3: force",
			       .fd = -1,
			       .trigger_folder = folder,
			       .setup = {.rate_hz = 10000, .full_scale_V = 3.3}};

	the_voltage()->attributes[0].key = "sampling_frequency";
	adc()->attributes[2].key = "else";
	the_voltage()->format.is_signed = true;
	assert_int_equal(iio_source_open(&s, "adc", &err), 0);
	assert_true(s.full_scale_V == 3.3);
	assert_true(s.offset_V == -1.65);
	assert_string_equal(the_voltage()->attributes[0].text, "10000");
	iio_source_close(&s);
}

TEST(channels, setup)
{
	static const struct {
		const char *id;
		int channel;
		bool found;
	} cases[] = {{"voltage1", 1, true},	     {"voltage1", 0, false},
		     {"voltage1-voltage2", 1, true}, {"voltage10", 1, false},
		     {"voltage10", 10, true},	     {"current1", 1, false}};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		the_voltage()->id = cases[i].id;
		assert_ptr_equal(find_voltage(adc(), cases[i].channel),
				 cases[i].found ? the_voltage() : NULL);
	}
}

/* Of drivers of Linux; in the last two, names are not enough or are needed. */
TEST(several_channels, setup)
{
	static const char *const ads1115[] = {
		"voltage0-voltage1", "voltage0-voltage3", "voltage1-voltage3",
		"voltage2-voltage3", "voltage0",	  "voltage1",
		"voltage2",	     "voltage3",	  NULL};
	static const char *const bridges[] = {"voltage0-voltage1", "voltage2-voltage3",
					      "voltage2-voltage1", NULL};
	static const char *const twins[] = {"voltage0", "voltage0", "voltage0-voltage1",
					    NULL};
	static const struct {
		const char *const *ids;
		const char *name; /* of the second */
		const char *asked;
		int found; /* -1: none */
	} cases[] = {
		{ads1115, NULL, "0", 4},
		{ads1115, NULL, "3", 7},
		{ads1115, NULL, "4", -1},
		{ads1115, NULL, "voltage0-voltage3", 1},
		{ads1115, NULL, "voltage2", 6},
		{ads1115, NULL, "voltage", -1},
		{ads1115, NULL, "voltage3-voltage0", -1},
		{bridges, NULL, "0", 0},
		{bridges, NULL, "1", -1},
		{bridges, NULL, "2", -1},
		{bridges, NULL, "voltage2-voltage1", 2},
		{twins, "grip", "0", 0},
		{twins, "grip", "voltage0_grip", 1},
		{twins, "grip", "voltage0_blade", -1},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct iio_device *d = adc();
		const char *asked = cases[i].asked;
		char known[200];

		for (d->n_channels = 0; cases[i].ids[d->n_channels]; d->n_channels++)
			d->channels[d->n_channels] =
				(struct iio_channel){.id = cases[i].ids[d->n_channels]};
		d->channels[1].name = cases[i].name;
		assert_ptr_equal(*asked <= '9' ? find_voltage(d, atoi(asked))
					       : find_named(d, asked),
				 cases[i].found < 0 ? NULL
						    : &d->channels[cases[i].found]);
		iio_source_list_channels(d, known, sizeof(known));
		assert_says(known, d->channels[d->n_channels - 1].id);
		assert_true(!cases[i].name || strstr(known, "voltage0, voltage0_grip, "));
		iio_source_list_channels(d, known, 12);
		assert_true(strlen(known) < 12);
	}
}

TEST(names_in_the_setup, setup)
{
	s = (struct iio_source){.where = "rig.conf:3: force", .device = adc()};
	strcpy(s.setup.channel_name, "voltage0-voltage1");
	assert_error(take_channels(&s, &err), ENODEV, &err, "voltage0-voltage1",
		     "in quotes: voltage0");
	strcpy(s.setup.channel_name, "voltage0");
	assert_int_equal(take_channels(&s, &err), 0);
	assert_ptr_equal(s.voltage, the_voltage());
	s.setup.reference = INCISE_FORCE_DIFFERENTIAL;
	assert_error(take_channels(&s, &err), EINVAL, &err, "force_setup.reference");
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
		the_voltage()->no_scan = true;
		break;
	case 5:
		adc()->n_channels = 2;
		break;
	case 6:
		the_voltage()->format.bits = 32;
		the_voltage()->format.length = 32;
		break;
	case 7:
		the_voltage()->attributes[0].key = "else";
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

TEST(refusals, setup)
{
	static const struct {
		int what;
		const char *name, *trigger;
		int code;
		const char *says;
	} cases[] = {
		{1, "adc", "", ENOSYS, "driver"},
		{0, "other", "", ENODEV, "\"other\""},
		{0, "timer", "", ENODEV, "\"timer\""},
		{2, "adc", "", EBUSY, "program"},
		{3, "adc", "", EACCES, "group"},
		{4, "adc", "", ENODEV, "quotes: none"},
		{5, "adc", "", EOPNOTSUPP, "timestamps"},
		{6, "adc", "", EOPNOTSUPP, "32 bits"},
		{7, "adc", "", EINVAL, "force_setup.full_scale_V"},
		{8, "adc", "", EOPNOTSUPP, "\"realtime\""},
		{9, "adc", "", EACCES, "clock"},
		{10, "adc", "", ENODEV, "trigger"},
		{0, "adc", "none", ENODEV, "\"none\""},
		{0, "adc", "adc", ENODEV, "\"adc\""},
		{14, "adc", "timer", EINVAL, "\"timer\""},
		{11, "adc", "", EOPNOTSUPP, "rate"},
		{12, "adc", "", EINVAL, "force_setup.rate_hz"},
		{13, "adc", "", EACCES, "rate"},
		{15, "adc", "", EINVAL, "10000 Hz"},
		{12, "adc", "timer", EINVAL, "1000 Hz"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		setup(NULL);
		broken(cases[i].what);
		assert_error(open_source(&s, cases[i].name, 10000, cases[i].trigger,
					 &err),
			     cases[i].code, &err, "rig.conf:3: force: ", cases[i].says);
		iio_source_close(&s);
		assert_int_equal(world.made, 0);
	}
}

/* --- buffer --- */

static char buffer_folder[64];
static int ends[2];

static void put(const char *name, const char *text)
{
	char path[200];
	FILE *f;

	snprintf(path, sizeof(path), "%s/%s", buffer_folder, name);
	f = fopen(path, "w");
	assert_non_null(f);
	fputs(text, f);
	fclose(f);
}

/* Files keep what was behind a shorter write: the first character decides. */
static char first_of(const char *name)
{
	char path[200];
	FILE *f;
	int c;

	snprintf(path, sizeof(path), "%s/%s", buffer_folder, name);
	f = fopen(path, "r");
	assert_non_null(f);
	c = fgetc(f);
	fclose(f);
	return (char)c;
}

static int buffer_setup(void **state)
{
	static const char *const folders[] = {"", "/scan_elements", "/buffer"};
	static const char *const files[] = {"in_voltage0_en", "in_voltage1_grip_en",
					    "in_timestamp_en"};
	char path[200];

	snprintf(buffer_folder, sizeof(buffer_folder), "/tmp/incise-test-XXXXXX");
	if (!mkdtemp(buffer_folder))
		return -1;
	for (size_t i = 1; i < 3; i++) {
		snprintf(path, sizeof(path), "%s%s", buffer_folder, folders[i]);
		mkdir(path, 0755);
	}
	for (size_t i = 0; i < 3; i++) {
		snprintf(path, sizeof(path), "scan_elements/%s", files[i]);
		put(path, "1");
	}
	put("buffer/length", "2");
	put("buffer/watermark", "1");
	put("buffer/enable", "0");
	return pipe2(ends, O_NONBLOCK);
}

static int drop(const char *path, const struct stat *status, int type, struct FTW *at)
{
	return remove(path);
}

static int buffer_teardown(void **state)
{
	close(ends[0]);
	close(ends[1]);
	return nftw(buffer_folder, drop, 8, FTW_DEPTH | FTW_PHYS);
}

/* A converter of which the second channel, named, is sampled: "le:s24/32>>8". */
static struct iio_source source_of(struct iio_channel *voltage,
				   struct iio_channel *timestamp)
{
	*voltage = (struct iio_channel){.id = "voltage1", .name = "grip", .index = 1};
	*timestamp = (struct iio_channel){.id = "timestamp", .index = 2};
	return (struct iio_source){
		.fd = ends[0],
		.voltage = voltage,
		.timestamp = timestamp,
		.format = {.bytes = 4, .bits = 24, .shift = 8, .is_signed = true},
		.timestamp_format = {.bytes = 8, .bits = 64, .is_signed = true},
	};
}

TEST(starts_and_stops, buffer_setup, buffer_teardown)
{
	struct iio_channel voltage, timestamp;
	struct iio_source source = source_of(&voltage, &timestamp);

	assert_int_equal(iio_source_start(&source, buffer_folder, 50, 7000), 0);
	assert_int_equal(first_of("scan_elements/in_voltage0_en"), '0');
	assert_int_equal(first_of("scan_elements/in_voltage1_grip_en"), '1');
	assert_int_equal(first_of("scan_elements/in_timestamp_en"), '1');
	assert_int_equal(first_of("buffer/length"), '7');
	assert_int_equal(first_of("buffer/watermark"), '5');
	assert_int_equal(first_of("buffer/enable"), '1');
	iio_source_stop(&source);
	assert_int_equal(first_of("buffer/enable"), '0');
	assert_int_equal(first_of("scan_elements/in_timestamp_en"), '0');
	iio_source_stop(&source);
}

TEST(does_not_start, buffer_setup, buffer_teardown)
{
	struct iio_channel voltage, timestamp;
	struct iio_source source = source_of(&voltage, &timestamp);

	voltage.name = "other";
	assert_int_equal(iio_source_start(&source, buffer_folder, 50, 7000), -ENOENT);
	assert_int_equal(iio_source_start(&source, "/nonexistent", 50, 7000), -ENOENT);
	iio_source_stop(&source);
}

/* Elements stand on multiples of their size, in the order of their index. */
TEST(layouts, buffer_setup, buffer_teardown)
{
	static const struct {
		unsigned int bytes;
		long index, stamp_index;
		size_t step, voltage_at, stamp_at;
	} cases[] = {
		{1, 0, 1, 16, 0, 8}, {2, 0, 1, 16, 0, 8}, {4, 3, 9, 16, 0, 8},
		{8, 0, 1, 16, 0, 8}, {2, 1, 0, 16, 8, 0}, {8, 1, 0, 16, 8, 0},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct iio_channel voltage, timestamp;
		struct iio_source source = source_of(&voltage, &timestamp);

		source.format.bytes = cases[i].bytes;
		voltage.index = cases[i].index;
		timestamp.index = cases[i].stamp_index;
		assert_int_equal(iio_source_start(&source, buffer_folder, 5, 10), 0);
		assert_int_equal(source.step, cases[i].step);
		assert_int_equal(source.voltage_at, cases[i].voltage_at);
		assert_int_equal(source.timestamp_at, cases[i].stamp_at);
		iio_source_stop(&source);
	}
}

TEST(scans_are_read, buffer_setup, buffer_teardown)
{
	static const struct {
		uint32_t volts;
		uint32_t filling;
		int64_t t_ns;
	} scans[] = {{0x80000012, 7, 1}, {0x000001ff, 8, -2}, {0x7fffff00, 9, INT64_MAX}};
	static const int32_t codes[] = {0, 0x800001, 0xffffff};
	struct iio_channel voltage, timestamp;
	struct iio_source source = source_of(&voltage, &timestamp);

	assert_int_equal(iio_source_start(&source, buffer_folder, 5, 10), 0);
	assert_int_equal(iio_source_read(&source), -EAGAIN);
	assert_int_equal(write(ends[1], scans, sizeof(scans)), sizeof(scans));
	assert_int_equal(iio_source_read(&source), 3);
	for (int i = 0; i < 3; i++) {
		assert_int_equal(iio_source_code(&source, i), codes[i]);
		assert_true(iio_source_timestamp(&source, i) == scans[i].t_ns);
	}
	/* what no device does */
	assert_int_equal(write(ends[1], scans, 7), 7);
	assert_int_equal(iio_source_read(&source), -EIO);
	source.fd = -1;
	assert_int_equal(iio_source_read(&source), -EBADF);
	iio_source_stop(&source);
}
