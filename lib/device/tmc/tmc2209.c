// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A TMC2209 on its UART: "tmc2209:TTY:NODE", node 0 to 3 by its pins MS1 and MS2. One wire carries both
 * ways, so the program also receives what it sends, or does not, by the adapter.
 *
 *   read   05 node reg crc             ─▶  05 ff reg d3 d2 d1 d0 crc
 *   write  05 node reg|80 d3…d0 crc        no answer; register IFCNT counts it
 *
 * Data sheet TMC2209 rev. 1.09, chapters 4 and 5.
 */
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>
#include "../../base/monotonic.h"
#include "../../rig/backends.h"
#include "../../rig/tty.h"
#include "tmc_driver.h"

#define IFCNT 0x02
#define NODECONF 0x03
#define SGTHRS 0x40
#define SG_RESULT 0x41
#define COOLCONF 0x42
#define VSENSE (1u << 17) /* in CHOPCONF: full current at SENSE_LOW_V */
#define SENSE_LOW_V 0.180

#define SYNC 0x05 /* the upper four bits are free */
#define TO_MASTER 0xff
#define TRIES 3
#define ANSWER_BYTES 8

/* x^8 + x^2 + x + 1, the lowest bit of each byte first. */
static uint8_t crc8(const uint8_t *bytes, int n)
{
	uint8_t crc = 0;

	for (int i = 0; i < 8 * n; i++) {
		bool one = (crc >> 7 ^ bytes[i / 8] >> i % 8) & 1;

		crc = (uint8_t)(crc << 1) ^ (one ? 7 : 0);
	}
	return crc;
}

static int send_datagram(const struct tmc_driver *d, uint8_t *bytes, int n)
{
	bytes[n - 1] = crc8(bytes, n - 1);
	/* Late bytes of an earlier answer. */
	tcflush(d->line->fd, TCIFLUSH);
	return write(d->line->fd, bytes, (size_t)n) == n ? 0 : -EIO;
}

/* The last bytes that came are an answer; the echo before them is none. */
static bool parse_answer(const uint8_t *a, uint8_t reg, uint32_t *value)
{
	if ((a[0] & 15) != SYNC || a[1] != TO_MASTER || a[2] != reg ||
	    a[7] != crc8(a, ANSWER_BYTES - 1))
		return false;
	*value = (uint32_t)a[3] << 24 | (uint32_t)a[4] << 16 | (uint32_t)a[5] << 8 | a[6];
	return true;
}

static int receive_answer(const struct tmc_driver *d, uint8_t reg, uint32_t *value)
{
	int64_t end_ns = incise_monotonic_ns(), left_ns;
	struct pollfd wait = {.fd = d->line->fd, .events = POLLIN};
	uint8_t bytes[64];

	end_ns += (int64_t)(d->actuator.tmc.answer_s * INCISE_NS_PER_S);
	for (size_t n = 0; n < sizeof(bytes); n++) {
		left_ns = end_ns - incise_monotonic_ns();
		if (poll(&wait, 1, left_ns > 0 ? (int)(left_ns / 1000000) : 0) <= 0)
			return -ETIMEDOUT;
		if (read(d->line->fd, bytes + n, 1) != 1)
			return -EIO;
		if (n + 1 >= ANSWER_BYTES &&
		    parse_answer(bytes + n + 1 - ANSWER_BYTES, reg, value))
			return 0;
	}
	return -EBADMSG;
}

static int read_2209(struct tmc_driver *d, uint8_t reg, uint32_t *value)
{
	int rc = -EIO;

	for (int i = 0; rc && i < TRIES; i++) {
		uint8_t bytes[] = {SYNC, d->node, reg, 0};

		d->repeats += i > 0;
		rc = send_datagram(d, bytes, sizeof(bytes));
		if (!rc)
			rc = receive_answer(d, reg, value);
	}
	return rc;
}

static int write_2209(struct tmc_driver *d, uint8_t reg, uint32_t value)
{
	uint32_t before, after;
	int rc = read_2209(d, IFCNT, &before);

	for (int i = 0; !rc && i < TRIES; i++) {
		uint8_t bytes[] = {SYNC,
				   d->node,
				   reg | TMC_WRITE,
				   (uint8_t)(value >> 24),
				   (uint8_t)(value >> 16),
				   (uint8_t)(value >> 8),
				   (uint8_t)value,
				   0};

		d->repeats += i > 0;
		rc = send_datagram(d, bytes, sizeof(bytes));
		if (!rc)
			rc = read_2209(d, IFCNT, &after);
		if (!rc && (uint8_t)(after - before) == 1)
			return 0;
	}
	return rc ? rc : -EPROTO;
}

/* Use the line of another chip of this rig; 1 without one on it. */
static int share_line(struct tmc_driver *d, const struct incise_backend_request *request,
		      size_t length, struct incise_error *err)
{
	for (int i = 0; i < request->n_drivers; i++) {
		struct tmc_driver *other = (struct tmc_driver *)request->drivers[i];

		if (strncmp(other->actuator.driver, d->actuator.driver, length))
			continue;
		if (other->node == d->node)
			return incise_error_set(err, EINVAL,
						"%s: %s is already the chip of another "
						"actuator; give each its own node",
						request->where, d->actuator.driver);
		d->line = other->line;
		return 0;
	}
	return 1;
}

static int connect_2209(struct tmc_driver *d,
			const struct incise_backend_request *request,
			struct incise_error *err)
{
	const char *all = d->actuator.driver, *colon = strrchr(all, ':');
	int length = (int)strlen(request->arguments) - 2;
	char path[sizeof(d->actuator.driver)];
	int rc;

	if (length < 1 || strlen(colon) != 2 || colon[1] < '0' || colon[1] > '3')
		return incise_error_set(
			err, EINVAL,
			"%s: expected tmc2209:TTY:NODE with a node from 0 to 3, for "
			"example tmc2209:/dev/serial0:0, found %s; correct it",
			request->where, all);
	d->node = (uint8_t)(colon[1] - '0');
	rc = share_line(d, request, (size_t)(colon - all) + 1, err);
	if (rc <= 0)
		return rc;
	snprintf(path, sizeof(path), "%.*s", length, request->arguments);
	d->fd = incise_tty_open(path, B115200);
	if (d->fd >= 0)
		return 0;
	return incise_tty_refuse(path, -d->fd, request->where, "that of the chip", err);
}

static int fill_2209(const struct tmc_driver *d, struct tmc_row *rows, double *most_A)
{
	const struct incise_actuator_tmc *tmc = &d->actuator.tmc;
	bool low = tmc->run_A <= tmc_full_A(d, SENSE_LOW_V);
	uint32_t chopper = 0x00010053; /* TOFF 3, HSTRT 5, TBL 2 */

	*most_A = tmc_full_A(d, low ? SENSE_LOW_V : TMC_SENSE_V);
	const struct tmc_row all[] = {
		/* A pause before an answer, which several nodes on a line need. */
		{NODECONF, false, 2u << 8},
		/* pdn_disable, mstep_reg_select, multistep_filt; no current by VREF */
		{TMC_GCONF, true, 0x1c0u | (tmc->stealthchop ? 0 : 1u << 2)},
		{TMC_IHOLD_IRUN, false, tmc_currents(d, *most_A)},
		{TMC_TPOWERDOWN, false, TMC_POWER_DOWN},
		{TMC_TPWMTHRS, false, tmc_step_clocks(d, tmc->stealthchop_mm_s)},
		{TMC_TCOOLTHRS, false, tmc_step_clocks(d, tmc->stall_mm_s)},
		{SGTHRS, false, (uint32_t)tmc->stall_threshold},
		{COOLCONF, false, 0},
		{TMC_PWMCONF, true, 0xc10d0024}, /* as after a reset */
		{TMC_CHOPCONF, true, chopper | (low ? VSENSE : 0) | tmc_microsteps(d)},
	};

	memcpy(rows, all, sizeof(all));
	return sizeof(all) / sizeof(*all);
}

static void *open_tmc2209(const struct incise_backend_request *request,
			  struct incise_error *err)
{
	static const struct tmc_model model = {
		.name = "TMC2209",
		.inputs = 0x06,
		.version = 0x21,
		.warm = 1u << 0,
		.hot = 1u << 1,
		.shorted = 15u << 2,
		.open = 3u << 6,
		.stealth = 1u << 30,
		.threshold_most = 255,
		.threshold_load = 2,
		.load = SG_RESULT,
		.stall_in_stealthchop = true,
		.sense_extra_ohm = 0.020,
		.connect = connect_2209,
		.read = read_2209,
		.write = write_2209,
		.fill = fill_2209,
	};

	return tmc_driver_open(request, &model, err);
}

INCISE_BACKEND(incise_driver_tmc2209, "driver", "tmc2209", .open = open_tmc2209);
