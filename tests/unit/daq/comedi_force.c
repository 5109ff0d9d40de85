// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/daq/comedi_force.c on a card that a test simulates, whose file is a pipe: its set-up, times
 * from the arrival of blocks, samples, and the search.
 */
#include "../unit.h"
#include <sched.h>
#include <stdatomic.h>
#include "../../../lib/base/monotonic.h"

/* The clock stands unless a test moves it: a busy machine is no silent card. */
static _Atomic int64_t clock_ns;
#define incise_monotonic_ns() atomic_load(&clock_ns)
#include "../../../lib/device/daq/comedi_force.c"
#include "card.h"
#include "found.h"

/* --- card --- */

static int card_setup(void **state)
{
	card_reset();
	return 0;
}

TEST(bits, card_setup)
{
	static const struct {
		lsampl_t maxdata;
		int bits;
	} cases[] = {{1, 1},	{4095, 12}, {65535, 16},      {0xffffff, 24}, {0, 0},
		     {4096, 0}, {4000, 0},  {0x7fffffff, 31}, {0xffffffff, 0}};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++)
		assert_int_equal(bits_of(cases[i].maxdata), cases[i].bits);
}

TEST(ranges, card_setup)
{
	static const comedi_range all[] = {
		{-10, 10, UNIT_volt},  {-5, 5, UNIT_volt}, {-2.5, 2.5, UNIT_volt},
		{0, 5, UNIT_volt},     {0, 0.02, UNIT_mA}, {0, 4.095, UNIT_volt},
		{NAN, NAN, UNIT_volt},
	};
	static const struct {
		double full_scale_V;
		int range;
	} cases[] = {{0, 0},	{5, 3},	 {4.9, 3}, {4.096, 5}, {0.01, 5},
		     {5.01, 1}, {10, 1}, {20, 0},  {20.1, -1}};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++)
		assert_int_equal(choose_range(all, 7, cases[i].full_scale_V),
				 cases[i].range);
	assert_int_equal(choose_range(all, 0, 0), -1);
}

static int open_card(struct card *c, const char *arguments, double rate_hz,
		     struct incise_error *err)
{
	*c = (struct card){.where = "rig.conf:3: force"};
	c->setup.rate_hz = rate_hz;
	c->setup.full_scale_V = 5;
	c->setup.channel = 3;
	return card_open(c, arguments, err);
}

TEST(is_set_up, card_setup)
{
	struct card c;

	assert_int_equal(open_card(&c, "/dev/comedi0:0", 10000, &err), 0);
	assert_int_equal(c.bits, 12);
	/* 0 … 5 V, of which 4095 is the top */
	assert_true(fabs(c.full_scale_V - 5.0 * 4096 / 4095) < 1e-12);
	assert_true(c.offset_V == 0);
	assert_true(c.period_ns == 100000);
	assert_false(c.wide);
	assert_int_equal(card_start(&c), 0);
	assert_int_equal(card.chanspec, CR_PACK(3, 1, AREF_GROUND));
	assert_int_equal(card.command.stop_src, TRIG_NONE);
	assert_int_equal(card.command.scan_end_arg, 1);
	card_close(&c);
	card_close(&c);
	assert_int_equal(card.opened, 0);
	assert_int_equal(card.cancelled, 1);
}

/* The accepted rate is reported; the buffer grows up to its limit. */
TEST(the_rest_of_a_card, card_setup)
{
	struct card c;

	card.flags = SDF_CMD_READ | SDF_DIFF | SDF_LSAMPL;
	card.convert_timer = true;
	card.buffer_size = 4096;
	card.maxdata = 0xffffff;
	assert_int_equal(open_card(&c, "/dev/comedi0", 9983, &err), 0);
	assert_true(c.wide);
	assert_int_equal(c.bits, 24);
	assert_true(c.period_ns == 100000);
	assert_int_equal(card.buffer_size, 1 << 16);
	assert_int_equal(CR_AREF(c.chanlist[0]), AREF_DIFF);
	card_close(&c);
}

TEST(what_an_input_is_compared_with, card_setup)
{
	static const struct {
		int flags;
		enum incise_force_reference asked;
		int is; /* -1: refused */
		const char *note;
	} cases[] = {
		{SDF_GROUND, INCISE_FORCE_ANY, AREF_GROUND, ""},
		{SDF_GROUND | SDF_DIFF, INCISE_FORCE_ANY, AREF_GROUND,
		 "ground, differential"},
		{SDF_COMMON | SDF_DIFF, INCISE_FORCE_ANY, AREF_COMMON,
		 "common, differential"},
		{SDF_GROUND | SDF_DIFF, INCISE_FORCE_DIFFERENTIAL, AREF_DIFF, ""},
		{SDF_GROUND | SDF_DIFF, INCISE_FORCE_GROUND, AREF_GROUND, ""},
		{SDF_GROUND | SDF_DIFF, INCISE_FORCE_COMMON, -1, "ground, differential"},
		{SDF_OTHER, INCISE_FORCE_ANY, AREF_OTHER, ""},
		{SDF_OTHER, INCISE_FORCE_DIFFERENTIAL, -1, "none"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct card c = {.where = "rig.conf:3: force",
				 .path = "/dev/comedi0",
				 .setup.reference = cases[i].asked};
		struct incise_error err = {0};
		int rc = take_reference(&c, cases[i].flags, &err);

		assert_int_equal(rc, cases[i].is < 0 ? -EINVAL : 0);
		assert_says(rc ? err.text : c.note, cases[i].note);
		assert_true(rc || (!*c.note == !*cases[i].note &&
				   (int)c.reference == cases[i].is));
	}
}

TEST(refusals, card_setup)
{
	static const struct {
		const char *arguments;
		double rate_hz;
		void *field; /* of the card, set to @value */
		int value, code;
		const char *says;
	} cases[] = {
		{"comedi0:0", 1e4, NULL, 0, EINVAL, "comedi:"},
		{"/dev/comedi0:", 1e4, NULL, 0, EINVAL, "comedi:"},
		{"/dev/comedi0:x", 1e4, NULL, 0, EINVAL, "comedi:"},
		{"/dev/comedi0:-1", 1e4, NULL, 0, EINVAL, "comedi:"},
		{"/dev/comedi0:4294967296", 1e4, NULL, 0, EINVAL, "comedi:"},
		{"", 1e4, NULL, 0, EINVAL, "comedi:"},
		{"/dev/comedi0", 1e4, &card.open_error, EACCES, EACCES, "group"},
		{"/dev/comedi0", 1e4, &card.open_error, ENOENT, ENOENT, "driver"},
		{"/dev/comedi0:1", 1e4, NULL, 0, EOPNOTSUPP, "subdevice 1"},
		{"/dev/comedi0:7", 1e4, NULL, 0, EOPNOTSUPP, "subdevice 7"},
		{"/dev/comedi0", 1e4, &card.type, COMEDI_SUBD_AO, EOPNOTSUPP,
		 "subdevice"},
		{"/dev/comedi0", 1e4, &card.flags, SDF_CMD_READ | SDF_BUSY, EBUSY,
		 "program"},
		{"/dev/comedi0", 1e4, &card.n_channels, 3, EINVAL, "force_setup.channel"},
		{"/dev/comedi0", 1e4, &card.maxdata, 5000, EOPNOTSUPP, "5000"},
		{"/dev/comedi0", 1e4, &card.n_ranges, 0, ERANGE, "none"},
		{"/dev/comedi0", 1e4, &card.no_timer, 1, EOPNOTSUPP, "sampling"},
		{"/dev/comedi0", 1e4, &card.period_least_ns, 200000, EINVAL, "5000 Hz"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct card c;

		card_reset();
		if (cases[i].field == &card.no_timer)
			card.no_timer = true;
		else if (cases[i].field)
			*(int *)cases[i].field = cases[i].value;
		assert_error(open_card(&c, cases[i].arguments, cases[i].rate_hz, &err),
			     cases[i].code, &err, "rig.conf:3: force: ", cases[i].says);
		card_close(&c);
		assert_int_equal(card.opened, 0);
	}
}

TEST(card_does_not_start, card_setup)
{
	struct card c;

	assert_int_equal(open_card(&c, "/dev/comedi0:0", 10000, &err), 0);
	card.command_error = EBUSY;
	assert_int_equal(card_start(&c), -EBUSY);
	card_close(&c);
}

/* --- times --- */

#define T 100000.0
#define START 7000000000LL

/*
 * Blocks of @block samples over @seconds, each late by @delay_ns and up to @jitter_ns more;
 * the card's clock is off by @ppm. The most that a timestamp is off by in the last half, ns.
 */
static double error_of(int block, double delay_ns, double jitter_ns, double ppm,
		       int seconds)
{
	struct times timestamps;
	double period = T * (1 + ppm * 1e-6), most = 0;
	int64_t last = 0;
	int n = 0;

	srand(1);
	times_init(&timestamps, T);
	times_start(&timestamps, START);
	while (n < seconds * 10000) {
		double late = delay_ns + jitter_ns * rand() / RAND_MAX;
		int64_t arrival = START + llround(period * (n + block) + late);

		times_block(&timestamps, arrival, (uint64_t)block, true);
		for (int i = 0; i < block; i++) {
			int64_t t = times_next(&timestamps);
			double off = (double)(t - START) - period * ++n;

			assert_true(t > last);
			/* half a nanosecond of rounding, up */
			assert_true(t <= arrival + 1);
			last = t;
			if (n > seconds * 5000)
				most = fmax(most, fabs(off));
		}
	}
	return most;
}

TEST(times)
{
	static const struct {
		int block;
		double delay_ns, jitter_ns, ppm;
		double most_ns;
	} cases[] = {
		/* a sound clock: exact but for rounding, however late blocks come */
		{1, 0, 0, 0, 2},
		{80, 0, 0, 0, 2},
		{512, 2e6, 0, 0, 2},
		/* the least of 125 delays of a second is within some 3 % of the jitter */
		{80, 1e6, 4e6, 0, 300e3},
		/* 100 ppm: 0.1 ms a second, followed with a second's delay or two */
		{80, 0, 0, 100, 250e3},
		{80, 1e6, 0, -100, 350e3},
		{80, 1e6, 1e6, 200, 700e3},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		double most = error_of(cases[i].block, cases[i].delay_ns,
				       cases[i].jitter_ns, cases[i].ppm, 60);

		if (most > cases[i].most_ns)
			fail_msg("case %zu: off by %.0f ns", i, most);
	}
}

/* Started again: timestamps go on behind those before. */
TEST(again)
{
	struct times timestamps;
	int64_t last;

	times_init(&timestamps, T);
	times_start(&timestamps, START);
	times_block(&timestamps, START + 1000000, 10, true);
	for (int i = 0; i < 10; i++)
		last = times_next(&timestamps);
	assert_int_equal(last, START + 1000000);
	times_start(&timestamps, START + 5000000);
	times_block(&timestamps, START + 5200000, 2, true);
	assert_int_equal(times_next(&timestamps), START + 5100000);
	/* a clock of the computer that stood still */
	times_start(&timestamps, START);
	times_block(&timestamps, START, 2, true);
	assert_int_equal(times_next(&timestamps), START + 5100001);
	assert_int_equal(times_next(&timestamps), START + 5100002);
}

/* A reader that was held for 5 s finds blocks of 4096 waiting: their timestamps stay true. */
TEST(held_up)
{
	struct times timestamps;
	int n = 0;

	times_init(&timestamps, T);
	times_start(&timestamps, START);
	while (n < 200000) {
		bool held = n >= 60000 && n < 110000;
		int block = held ? 4096 : 80;
		int64_t taken = START + llround(T * (n + block));
		/* from 6 s on all comes at 11 s */
		int64_t arrival = taken < START + 11000000000LL && n >= 60000
					  ? START + 11000000000LL
					  : taken;

		times_block(&timestamps, arrival, (uint64_t)block, block == 80);
		for (int i = 0; i < block; i++)
			assert_true(llabs(times_next(&timestamps) - START -
					  llround(T * ++n)) < 2);
	}
}

/* --- comedi_force --- */

static atomic_int fail; /* an errno for the next read, once; -1: the end of the command */

ssize_t __real_read(int fd, void *bytes, size_t size);

ssize_t __wrap_read(int fd, void *bytes, size_t size)
{
	int code = 0;
	ssize_t got = __real_read(fd, bytes, size);

	if (fd == card.pipe[0] && got < 0 && errno == EAGAIN) {
		code = atomic_exchange(&fail, 0);
		if (code < 0)
			return 0;
		errno = code ? code : EAGAIN;
	}
	return got;
}

static int setup(void **state)
{
	card_reset();
	atomic_store(&fail, 0);
	atomic_store(&clock_ns, START);
	return pipe(card.pipe);
}

static int teardown(void **state)
{
	close(card.pipe[0]);
	close(card.pipe[1]);
	return 0;
}

static struct incise_force *open_force(struct incise_error *err)
{
	static const struct incise_force_setup setup = {.rate_hz = 10000,
							.full_scale_V = 5};
	static const struct incise_backend_request request = {
		.arguments = "/dev/comedi0:0",
		.where = "rig.conf:3: force",
		.force = &setup};

	return incise_force_comedi.open(&request, err);
}

/* Until something comes, or the end. */
static int take(struct incise_force *force, struct incise_force_sample *samples, int n)
{
	int have = 0, rc = 0;

	while (have < n) {
		rc = incise_force_read(force, samples + have, n - have);
		if (rc < 0)
			return rc;
		have += rc;
		sched_yield();
	}
	return have;
}

static void send(const void *bytes, size_t size)
{
	assert_int_equal(write(card.pipe[1], bytes, size), size);
}

static void send_codes(int from, int n)
{
	for (int i = 0; i < n; i++) {
		sampl_t code = (sampl_t)(from + i);

		send(&code, sizeof(code));
	}
}

TEST(samples_come, setup, teardown)
{
	struct incise_force_sample samples[100];
	struct incise_force *force = open_force(&err);
	struct incise_force_info info;
	sampl_t dirty = 0xf123;

	assert_non_null(force);
	send_codes(1, 98);
	send(&dirty, sizeof(dirty)); /* bits above the 12 */
	send("\x00", 1);	     /* half a sample */
	send("\x00", 1);
	assert_int_equal(take(force, samples, 100), 100);
	for (int i = 0; i < 100; i++) {
		assert_int_equal(samples[i].seq, i);
		assert_true(!i || samples[i].t_ns > samples[i - 1].t_ns);
		assert_int_equal(samples[i].code, i < 98 ? i + 1 : i == 98 ? 0x123 : 0);
	}
	incise_force_info(force, &info);
	assert_string_equal(info.name, "fake-16 channel 0, by arrival");
	assert_true(info.rate_hz == 10000);
	assert_int_equal(info.clipped, 1);
	assert_int_equal(incise_force_lost(force), 0);
	force->ops->close(force);
	assert_int_equal(card.opened, 0);
}

TEST(wide_samples, setup, teardown)
{
	static const lsampl_t codes[] = {0, 0x123456, 0xffffff, 0x1234567};
	struct incise_force_sample samples[4];
	struct incise_force *force;

	card.flags |= SDF_LSAMPL;
	card.maxdata = 0xffffff;
	force = open_force(&err);
	assert_non_null(force);
	send(codes, 7);
	send((const char *)codes + 7, 9);
	assert_int_equal(take(force, samples, 4), 4);
	assert_int_equal(samples[1].code, 0x123456);
	assert_int_equal(samples[2].code, 0xffffff);
	assert_int_equal(samples[3].code, 0x234567);
	force->ops->close(force);
}

static void wait_for_command(int n)
{
	while (atomic_load(&card.commands) < n)
		sched_yield();
}

/* EPIPE: the command was ended for want of room. It is started again, with a gap. */
TEST(overflow, setup, teardown)
{
	static const int reasons[] = {EPIPE, -1};

	for (size_t i = 0; i < 2; i++) {
		struct incise_force_sample samples[20];
		struct incise_force_info info;
		struct incise_force *force;

		card.commands = 0;
		force = open_force(&err);
		assert_non_null(force);
		send_codes(100, 10);
		assert_int_equal(take(force, samples, 10), 10);
		atomic_store(&fail, reasons[i]);
		wait_for_command(2);
		send_codes(200, 10);
		assert_int_equal(take(force, samples + 10, 10), 10);
		incise_force_info(force, &info);
		assert_int_equal(info.overflows, 1);
		assert_int_equal(samples[9].seq, 9);
		assert_int_equal(samples[10].code, 200);
		/* One at least is lost, however short the time. */
		assert_int_equal(samples[10].seq, 11);
		assert_int_equal(samples[10].seq - 10, incise_force_lost(force));
		assert_int_equal(samples[19].seq, samples[10].seq + 9);
		assert_true(samples[10].t_ns > samples[9].t_ns);
		force->ops->close(force);
	}
}

TEST(unplugged, setup, teardown)
{
	static const struct {
		int code, reported;
	} cases[] = {{ENODEV, -ENODEV}, {ENXIO, -ENODEV}, {EIO, -EIO}, {EINVAL, -EIO}};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_force_sample samples[10];
		struct incise_force *force = open_force(&err);

		assert_non_null(force);
		send_codes(1, 3);
		assert_int_equal(take(force, samples, 3), 3);
		atomic_store(&fail, cases[i].code);
		assert_int_equal(take(force, samples, 1), cases[i].reported);
		force->ops->close(force);
	}
}

TEST(silent, setup, teardown)
{
	struct incise_force_sample samples[3];
	struct incise_error err = {0};
	struct incise_force *force = open_force(&err);

	assert_non_null(force);
	send_codes(1, 3);
	assert_int_equal(take(force, samples, 3), 3);
	/* ten periods more than this, and a nanosecond */
	atomic_fetch_add(&clock_ns, (int64_t)DEAD_NS + 1000001);
	assert_int_equal(take(force, samples, 1), -EIO);
	force->ops->close(force);
}

/* A command that ends again and again without a sample is given up. */
TEST(never_goes_on, setup, teardown)
{
	struct incise_force_sample sample;
	struct incise_force *force = open_force(&err);
	int rc = 0;

	assert_non_null(force);
	while (!rc) {
		atomic_store(&fail, EPIPE);
		rc = incise_force_read(force, &sample, 1);
		sched_yield();
	}
	assert_int_equal(rc, -EIO);
	assert_int_equal(card.commands, 6);
	force->ops->close(force);
}

TEST(does_not_start, setup, teardown)
{
	card.command_error = EBUSY;
	assert_error(open_force(&err), EBUSY, &err, "rig.conf:3: force: /dev/comedi0");
	assert_int_equal(card.opened, 0);
}

/* --- scan --- */

static struct found found;

static int scan_setup(void **state)
{
	card_reset();
	found = (struct found){0};
	return 0;
}

static int scan(const char *arguments)
{
	int rc = incise_force_comedi.scan(arguments, keep, &found, &err);

	assert_int_equal(card.opened, 0);
	/* Nothing is started by looking. */
	assert_int_equal(atomic_load(&card.commands), 0);
	return rc;
}

TEST(a_card_is_told_of, scan_setup)
{
	static const char *const properties[][2] = {
		{"path", "/dev/null"},
		{"board", "fake-16"},
		{"driver", "fake"},
		{"channels", "8"},
		{"bits", "12"},
		{"ranges_V", "-5 to 5, 0 to 5, -2.5 to 2.5"},
		{"rate_most_hz", "200000"}, /* 5 us, its least */
		{"rate_least_hz", "1"},
		{"time_stamps", "by arrival"},
	};

	/* Its second subdevice is not an analogue input. */
	assert_int_equal(scan("/dev/null:0"), 0);
	assert_int_equal(found.n, 1);
	assert_string_equal(found.device[0].device, "comedi:/dev/null:0");
	assert_true(found.device[0].usable);
	for (size_t i = 0; i < sizeof(properties) / sizeof(*properties); i++)
		assert_string_equal(property_of(&found.device[0], properties[i][0]),
				    properties[i][1]);
}

TEST(what_cannot_be_used_is_told_as_such, scan_setup)
{
	card.flags |= SDF_BUSY;
	assert_int_equal(scan("/dev/null"), 0);
	assert_non_null(strstr(found.device[0].what, ", in use"));
	scan_setup(NULL);
	card.no_timer = true;
	assert_int_equal(scan("/dev/null"), 0);
	assert_false(found.device[0].usable);
	assert_string_equal(property_of(&found.device[0], "rate_most_hz"), "");
	scan_setup(NULL);
	card.maxdata = 4000; /* codes of no whole number of bits */
	assert_int_equal(scan("/dev/null"), 0);
	assert_false(found.device[0].usable);
}

TEST(none, scan_setup)
{
	assert_int_equal(scan("/dev/not-there:0"), 0);
	card.open_error = EACCES;
	assert_int_equal(scan("/dev/null"), 0);
	card.open_error = 0;
	card.type = COMEDI_SUBD_AO;
	assert_int_equal(scan("/dev/null"), 0);
	card.type = COMEDI_SUBD_AI;
	card.flags = 0; /* one that samples when it is asked only */
	assert_int_equal(scan("/dev/null"), 0);
	assert_int_equal(found.n, 0);
}

TEST(it_ends_when_it_is_told_to, scan_setup)
{
	found.answer = -ENOMEM;
	assert_int_equal(scan("/dev/null"), -ENOMEM);
}
