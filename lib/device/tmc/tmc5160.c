// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A TMC5160 on SPI, used by step and direction: "tmc5160:/dev/spidev0.0". Never run with a chip: tests
 * compare the bytes with those of the data sheet.
 *
 *   sent      reg (|80 to write) d3 d2 d1 d0
 *   received  status, then the register or the data of the datagram before
 *
 * Data sheet TMC5160 rev. 1.18, chapters 4 and 6.
 */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <string.h>
#include <sys/ioctl.h>
#include <linux/spi/spidev.h>
#include "../../rig/backends.h"
#include "tmc_driver.h"

#define GLOBAL_SCALER 0x0b
#define COOLCONF 0x6d
#define DRV_STATUS 0x6f
#define DATAGRAM_BYTES 5
#define SPEED_HZ 1000000
#define SCALER_LEAST 128 /* smaller ones are less exact */

static void put_datagram(uint8_t to[DATAGRAM_BYTES], uint8_t address, uint32_t value)
{
	to[0] = address;
	for (int i = 1; i < DATAGRAM_BYTES; i++)
		to[i] = (uint8_t)(value >> (32 - 8 * i));
}

/* A datagram and a read, whose answer is that of the datagram; nobody comes between the two. */
static int exchange_datagrams(const struct tmc_driver *d, uint8_t address, uint32_t value,
			      uint32_t *answer)
{
	uint8_t out[2][DATAGRAM_BYTES], in[2][DATAGRAM_BYTES] = {0};
	struct spi_ioc_transfer transfer[2];

	put_datagram(out[0], address, value);
	put_datagram(out[1], TMC_GSTAT, 0);
	for (int i = 0; i < 2; i++)
		transfer[i] = (struct spi_ioc_transfer){
			.tx_buf = (uintptr_t)out[i],
			.rx_buf = (uintptr_t)in[i],
			.len = DATAGRAM_BYTES,
			.speed_hz = SPEED_HZ,
			.bits_per_word = 8,
			.cs_change = !i,
		};
	if (ioctl(d->fd, SPI_IOC_MESSAGE(2), transfer) < 0)
		return -errno;
	*answer = 0;
	for (int i = 1; i < DATAGRAM_BYTES; i++)
		*answer = *answer << 8 | in[1][i];
	return 0;
}

static int read_5160(struct tmc_driver *d, uint8_t reg, uint32_t *value)
{
	return exchange_datagrams(d, reg, 0, value);
}

static int write_5160(struct tmc_driver *d, uint8_t reg, uint32_t value)
{
	uint32_t taken;
	int rc = exchange_datagrams(d, reg | TMC_WRITE, value, &taken);

	return !rc && taken != value ? -EPROTO : rc;
}

static int connect_5160(struct tmc_driver *d,
			const struct incise_backend_request *request,
			struct incise_error *err)
{
	uint8_t mode = SPI_MODE_3;

	d->fd = open(request->arguments, O_RDWR | O_CLOEXEC);
	if (d->fd >= 0 && !ioctl(d->fd, SPI_IOC_WR_MODE, &mode))
		return 0;
	return incise_error_set(err, errno,
				"%s: %s: %s; name a device of spidev that this user may "
				"open, for example tmc5160:/dev/spidev0.0",
				request->where, request->arguments, strerror(errno));
}

static int fill_5160(const struct tmc_driver *d, struct tmc_row *rows, double *most_A)
{
	const struct incise_actuator_tmc *tmc = &d->actuator.tmc;
	double full_A = tmc_full_A(d, TMC_SENSE_V);
	double scaler = fmin(256, fmax(SCALER_LEAST, ceil(256 * tmc->run_A / full_A)));

	*most_A = full_A * scaler / 256;
	const struct tmc_row all[] = {
		/* multistep_filt, diag0_error and diag1_stall, which drive their pins */
		{TMC_GCONF, true, 0x3128u | (tmc->stealthchop ? 1u << 2 : 0)},
		{GLOBAL_SCALER, false, (uint32_t)scaler & 255}, /* 0 is 256 */
		{TMC_IHOLD_IRUN, false, tmc_currents(d, *most_A)},
		{TMC_TPOWERDOWN, false, TMC_POWER_DOWN},
		{TMC_TPWMTHRS, false, tmc_step_clocks(d, tmc->stealthchop_mm_s)},
		{TMC_TCOOLTHRS, false, tmc_step_clocks(d, tmc->stall_mm_s)},
		{COOLCONF, false, ((uint32_t)tmc->stall_threshold & 127) << 16},
		{TMC_PWMCONF, false, 0xc40c001e}, /* as after a reset */
		/* TOFF 3, HSTRT 4, HEND 1, TBL 2 */
		{TMC_CHOPCONF, true, 0x000100c3 | tmc_microsteps(d)},
	};

	memcpy(rows, all, sizeof(all));
	return sizeof(all) / sizeof(*all);
}

static void *open_tmc5160(const struct incise_backend_request *request,
			  struct incise_error *err)
{
	static const struct tmc_model model = {
		.name = "TMC5160",
		.inputs = 0x04,
		.version = 0x30,
		.used_by_steps = 1u << 6,
		.warm = 1u << 26,
		.hot = 1u << 25,
		.shorted = 3u << 12 | 3u << 27,
		.open = 3u << 29,
		.stealth = 1u << 14,
		.threshold_least = -64,
		.threshold_most = 63,
		.load = DRV_STATUS,
		.connect = connect_5160,
		.read = read_5160,
		.write = write_5160,
		.fill = fill_5160,
	};

	return tmc_driver_open(request, &model, err);
}

INCISE_BACKEND(incise_driver_tmc5160, "driver", "tmc5160", .open = open_tmc5160);
