// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/tmc/tmc5160.c: no SPI device and no chip can run here, so ioctl() is a chip made from the data
 * sheet, rev. 1.18: each datagram answers the one before. Bytes are compared with those of its examples.
 */
#include "../unit.h"
#include <linux/spi/spidev.h>
#include <stdatomic.h>
#include <sys/ioctl.h>
#include "../../../lib/rig/backends.h"
#include "../../../lib/device/tmc/tmc_driver.h"

extern const struct incise_backend incise_driver_tmc5160;

#define GLOBAL_SCALER 0x0b
#define COOLCONF 0x6d

static struct {
	uint32_t reg[128], answer;
	unsigned char sent[200][5];
	int n, mode, error;
	bool loses_data; /* of what is written */
} spi;

int __real_ioctl(int fd, unsigned long request, void *argument);

static void obey(const unsigned char *bytes)
{
	uint32_t value = (uint32_t)bytes[1] << 24 | (uint32_t)bytes[2] << 16 |
			 (uint32_t)bytes[3] << 8 | bytes[4];
	int reg = bytes[0] & 127;

	if (!(bytes[0] & 128)) {
		spi.answer = spi.reg[reg];
		return;
	}
	spi.reg[reg] = reg == TMC_GSTAT ? spi.reg[reg] & ~value : value;
	spi.answer = spi.loses_data ? 0 : value;
}

static void exchange(const struct spi_ioc_transfer *t)
{
	unsigned char *in = (unsigned char *)(uintptr_t)t->rx_buf;

	assert_int_equal(t->len, 5);
	in[0] = 0x08; /* standstill */
	for (int i = 0; i < 4; i++)
		in[1 + i] = (unsigned char)(spi.answer >> (24 - 8 * i));
	if (spi.n < 200)
		memcpy(spi.sent[spi.n++], (const void *)(uintptr_t)t->tx_buf, 5);
	obey((const unsigned char *)(uintptr_t)t->tx_buf);
}

int __wrap_ioctl(int fd, unsigned long request, void *argument)
{
	const struct spi_ioc_transfer *t = argument;

	if (request == SPI_IOC_WR_MODE) {
		spi.mode = *(uint8_t *)argument;
		return 0;
	}
	if (request != SPI_IOC_MESSAGE(2))
		return __real_ioctl(fd, request, argument);
	errno = spi.error;
	if (spi.error)
		return -1;
	/* A chip takes a datagram when its select line is released. */
	assert_true(t[0].cs_change && !t[1].cs_change);
	exchange(&t[0]);
	exchange(&t[1]);
	return 10;
}

static int begin(void **state)
{
	(void)state;
	memset(&spi, 0, sizeof(spi));
	spi.reg[TMC_GSTAT] = 1;
	spi.reg[0x04] = 0x30000040;
	spi.reg[0x12] = 0xfffff;
	spi.reg[0x6f] = 0x80000000;
	return 0;
}

static struct incise_actuator asked(void)
{
	return (struct incise_actuator){
		.travel_mm = 20,
		.lead_mm = 8,
		.steps_per_turn = 200,
		.microsteps = 256,
		.velocity_mm_s = 10,
		.driver = "tmc5160:/dev/null",
		.tmc = {.sense_ohm = 0.075,
			.run_A = 3.064,
			.hold_A = 1.0532,
			.stealthchop = true,
			.stealthchop_mm_s = 3.75},
	};
}

/* Without a thread, so that no look changes what was sent. */
static struct tmc_driver *open_chip(const struct incise_actuator *a, bool watch)
{
	return incise_driver_tmc5160.open(
		&(struct incise_backend_request){.arguments = a->driver + 8,
						 .where = "rig.conf:1: stepper: driver",
						 .actuator = a,
						 .watch = watch},
		&err);
}

static bool was_sent(const unsigned char bytes[5])
{
	bool sent = false;

	for (int i = 0; i < spi.n; i++)
		sent |= !memcmp(spi.sent[i], bytes, 5);
	return sent;
}

/*
 * The data sheet's examples: EC 000100C3 sets TOFF 3, HSTRT 4, HEND 1, TBL 2; 93 000001F4 sets TPWM_THRS to
 * 500; 90 00061F0A sets IHOLD 10, IRUN 31, here with another delay.
 */
TEST(settings_are_the_bytes_of_the_data_sheet, begin)
{
	struct incise_actuator a = asked();
	struct tmc_driver *d = open_chip(&a, false);

	succeeds(d);
	assert_int_equal(spi.mode, SPI_MODE_3);
	assert_true(was_sent((unsigned char[]){0xec, 0x00, 0x01, 0x00, 0xc3}));
	assert_true(was_sent((unsigned char[]){0x93, 0x00, 0x00, 0x01, 0xf4}));
	assert_true(was_sent((unsigned char[]){0x90, 0x00, 0x08, 0x1f, 0x0a}));
	assert_true(was_sent((unsigned char[]){0x81, 0x00, 0x00, 0x00, 0x07}));
	assert_true(was_sent((unsigned char[]){0x6c, 0x00, 0x00, 0x00, 0x00}));
	assert_int_equal(spi.reg[TMC_GCONF], 0x312c);
	assert_int_equal(spi.reg[GLOBAL_SCALER], 0); /* is 256 */
	d->driver.ops->close(&d->driver);
}

/* Full current is 0.325 V / 0.075 Ω / √2 = 3.064 A; below half of it the scaler stays. */
TEST(currents, begin)
{
	static const struct {
		double run_A, hold_A;
		uint32_t scaler, rows;
	} cases[] = {
		{3.064, 3.064, 0, 0x81f1f},
		{2.0, 1.0, 168, 0x81f0f},
		{0.766, 0.05, 128, 0x80f00},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_actuator a = asked();
		struct incise_stepper_chip chip;
		struct tmc_driver *d;

		a.tmc.run_A = cases[i].run_A;
		a.tmc.hold_A = cases[i].hold_A;
		d = open_chip(&a, false);
		succeeds(d);
		assert_int_equal(spi.reg[GLOBAL_SCALER], cases[i].scaler);
		assert_int_equal(spi.reg[TMC_IHOLD_IRUN], cases[i].rows);
		assert_int_equal(d->driver.ops->read(&d->driver, &chip), 0);
		/* Half a step of the scaler, and of the bits. */
		assert_float_equal(chip.run_A, cases[i].run_A, 3.064 / 256);
		d->driver.ops->close(&d->driver);
	}
}

/* DRV_STATUS has its bits elsewhere than a TMC2209, and a stall is a load of 0. */
TEST(faults, begin)
{
	static const struct {
		uint32_t state, status, fault;
		const char *text;
	} cases[] = {
		{0, 1u << 12, INCISE_STEPPER_FAULT_ALARM, "short circuit"},
		{0, 1u << 13, INCISE_STEPPER_FAULT_ALARM, "short circuit"},
		{0, 1u << 25, INCISE_STEPPER_FAULT_ALARM, "too hot"},
		{0, 1u << 27, INCISE_STEPPER_FAULT_ALARM, "short circuit"},
		{0, 1u << 28, INCISE_STEPPER_FAULT_ALARM, "short circuit"},
		{0, 1u << 29, INCISE_STEPPER_FAULT_ALARM, "open"},
		{0, 1u << 30, INCISE_STEPPER_FAULT_ALARM, "open"},
		{4, 0, INCISE_STEPPER_FAULT_ALARM, "supply is too low"},
		{1, 0, INCISE_STEPPER_FAULT_LOST, "restarted"},
		{0, 1u << 26, 0, ""}, /* a warning */
	};
	struct incise_actuator a = asked();
	struct tmc_driver *d = open_chip(&a, true);

	succeeds(d);
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		d->faults = d->open = 0;
		spi.reg[TMC_GSTAT] = cases[i].state;
		spi.reg[0x6f] = cases[i].status;
		for (int k = 0; k < 5; k++)
			tmc_driver_look(d);
		assert_int_equal(d->faults, cases[i].fault);
		if (cases[i].fault)
			assert_says(d->cause, cases[i].text);
	}
	assert_int_equal(d->warnings, 1);
	d->actuator.tmc.stall_mm_s = 5;
	spi.reg[0x12] = 300;
	spi.reg[0x6f] = 1;
	for (int k = 0; k < 5; k++)
		tmc_driver_look(d);
	assert_int_equal(d->faults, 0);
	spi.reg[0x6f] = 0;
	tmc_driver_look(d);
	tmc_driver_look(d);
	assert_int_equal(d->faults, INCISE_STEPPER_FAULT_FOLLOWING);
	d->driver.ops->close(&d->driver);
}

TEST(refused, begin)
{
	struct incise_actuator a = asked();

	spi.loses_data = true;
	assert_error(open_chip(&a, false), ENODEV, &err, a.driver, "Protocol error");
	spi.loses_data = false;
	spi.error = EIO;
	assert_error(open_chip(&a, false), ENODEV, &err, a.driver, "TMC5160");
	spi.error = 0;
	spi.reg[0x04] = 0x30000000;
	assert_error(open_chip(&a, false), ENODEV, &err, a.driver, "SD_MODE");
	spi.reg[0x04] = 0x30000040;
	a.tmc.stall_mm_s = 2;
	assert_error(open_chip(&a, false), ERANGE, &err, a.driver, "SpreadCycle");
	strcpy(a.driver, "tmc5160:/nowhere");
	assert_error(open_chip(&a, false), ENOENT, &err, "/nowhere");
}

GROUP(NULL, NULL);
