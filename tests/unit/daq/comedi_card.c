// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/daq/comedi_card.c on a card that a test makes: bits, ranges, the period that is
 * taken, and each refusal.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include "../../../lib/device/daq/comedi_card.h"
#include "card.h"

static int setup(void **state)
{
	card_reset();
	return 0;
}

static void bits(void **state)
{
	static const struct {
		lsampl_t maxdata;
		int bits;
	} cases[] = {{1, 1},	{4095, 12}, {65535, 16},      {0xffffff, 24}, {0, 0},
		     {4096, 0}, {4000, 0},  {0x7fffffff, 31}, {0xffffffff, 0}};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++)
		assert_int_equal(comedi_card_bits(cases[i].maxdata), cases[i].bits);
}

static void ranges(void **state)
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
		assert_int_equal(comedi_card_range(all, 7, cases[i].full_scale_V),
				 cases[i].range);
	assert_int_equal(comedi_card_range(all, 0, 0), -1);
}

static int open_card(struct comedi_card *c, const char *arguments, double rate_hz,
		     struct incise_error *err)
{
	*c = (struct comedi_card){.where = "rig.conf:3: force"};
	c->setup.rate_hz = rate_hz;
	c->setup.full_scale_V = 5;
	c->setup.channel = 3;
	return comedi_card_open(c, arguments, err);
}

static void is_set_up(void **state)
{
	struct incise_error err = {0};
	struct comedi_card c;

	assert_int_equal(open_card(&c, "/dev/comedi0:0", 10000, &err), 0);
	assert_int_equal(c.bits, 12);
	/* 0 … 5 V, of which 4095 is the top */
	assert_true(fabs(c.full_scale_V - 5.0 * 4096 / 4095) < 1e-12);
	assert_true(c.offset_V == 0);
	assert_true(c.period_ns == 100000);
	assert_false(c.wide);
	assert_int_equal(comedi_card_start(&c), 0);
	assert_int_equal(card.chanspec, CR_PACK(3, 1, AREF_GROUND));
	assert_int_equal(card.command.stop_src, TRIG_NONE);
	assert_int_equal(card.command.scan_end_arg, 1);
	comedi_card_close(&c);
	comedi_card_close(&c);
	assert_int_equal(card.opened, 0);
	assert_int_equal(card.cancelled, 1);
}

/* What it takes is what is told; its buffer grows as far as it may. */
static void the_rest_of_a_card(void **state)
{
	struct incise_error err = {0};
	struct comedi_card c;

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
	comedi_card_close(&c);
}

static void refusals(void **state)
{
	static const struct {
		const char *arguments;
		double rate_hz;
		void *field; /* of the card, set to @value */
		int value, code;
		const char *says;
	} cases[] = {
		{"comedi0:0", 1e4, NULL, 0, EINVAL, "expected comedi:DEVICE:SUBDEVICE"},
		{"/dev/comedi0:", 1e4, NULL, 0, EINVAL, "expected comedi:"},
		{"/dev/comedi0:x", 1e4, NULL, 0, EINVAL, "expected comedi:"},
		{"/dev/comedi0:-1", 1e4, NULL, 0, EINVAL, "expected comedi:"},
		{"/dev/comedi0:4294967296", 1e4, NULL, 0, EINVAL, "expected comedi:"},
		{"", 1e4, NULL, 0, EINVAL, "expected comedi:"},
		{"/dev/comedi0", 1e4, &card.open_error, EACCES, EACCES, "join the group"},
		{"/dev/comedi0", 1e4, &card.open_error, ENOENT, ENOENT,
		 "load the driver of your card"},
		{"/dev/comedi0:1", 1e4, NULL, 0, EOPNOTSUPP, "subdevice 1 is no analog"},
		{"/dev/comedi0:7", 1e4, NULL, 0, EOPNOTSUPP, "subdevice 7 is no analog"},
		{"/dev/comedi0", 1e4, &card.type, COMEDI_SUBD_AO, EOPNOTSUPP,
		 "is no analog input"},
		{"/dev/comedi0", 1e4, &card.flags, SDF_CMD_READ | SDF_BUSY, EBUSY,
		 "in use by another program"},
		{"/dev/comedi0", 1e4, &card.n_channels, 3, EINVAL,
		 "has channels 0 to 2; correct force_setup.channel"},
		{"/dev/comedi0", 1e4, &card.maxdata, 5000, EOPNOTSUPP,
		 "codes up to 5000 are not"},
		{"/dev/comedi0", 1e4, &card.n_ranges, 0, ERANGE, "(ranges in V: none)"},
		{"/dev/comedi0", 1e4, &card.no_timer, 1, EOPNOTSUPP, "by a timer"},
		{"/dev/comedi0", 1e4, &card.period_least_ns, 200000, EINVAL,
		 "does not take 10000 Hz, next to it is 5000 Hz"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_error err = {0};
		struct comedi_card c;

		card_reset();
		if (cases[i].field == &card.no_timer)
			card.no_timer = true;
		else if (cases[i].field)
			*(int *)cases[i].field = cases[i].value;
		assert_int_equal(open_card(&c, cases[i].arguments, cases[i].rate_hz,
					   &err),
				 -cases[i].code);
		if (!strstr(err.text, cases[i].says) ||
		    strncmp(err.text, "rig.conf:3: force: ", 19) != 0)
			fail_msg("case %zu: %s", i, err.text);
		comedi_card_close(&c);
		assert_int_equal(card.opened, 0);
	}
}

static void does_not_start(void **state)
{
	struct incise_error err = {0};
	struct comedi_card c;

	assert_int_equal(open_card(&c, "/dev/comedi0:0", 10000, &err), 0);
	card.command_error = EBUSY;
	assert_int_equal(comedi_card_start(&c), -EBUSY);
	comedi_card_close(&c);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup(bits, setup),
		cmocka_unit_test_setup(ranges, setup),
		cmocka_unit_test_setup(is_set_up, setup),
		cmocka_unit_test_setup(the_rest_of_a_card, setup),
		cmocka_unit_test_setup(refusals, setup),
		cmocka_unit_test_setup(does_not_start, setup),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
