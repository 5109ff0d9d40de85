/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * TMC2209 chips on one wire behind a pseudo terminal, in a thread: registers, the CRC and the counter of
 * datagrams as in the data sheet, rev. 1.09, chapter 4, and the echo of what the program sends.
 */
#ifndef INCISE_TEST_TMC_CHIP_H
#define INCISE_TEST_TMC_CHIP_H

#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define CHIP_GSTAT 0x01
#define CHIP_IFCNT 0x02
#define CHIP_IOIN 0x06
#define CHIP_TSTEP 0x12
#define CHIP_SG_RESULT 0x41
#define CHIP_CHOPCONF 0x6c
#define CHIP_DRV_STATUS 0x6f
#define CHIP_FRAMES 400

struct chip_line {
	_Atomic uint32_t reg[4][128];
	_Atomic uint32_t chopconf_stuck; /* bits that stay as they are */
	atomic_uint nodes;		 /* bits of the nodes that are there */
	atomic_bool mute_echo;
	/* So many requests are not heard, writes get lost, answers are damaged. */
	atomic_int deaf, lost_writes, garbled;
	unsigned char frame[CHIP_FRAMES][8]; /* of requests, in their order */
	atomic_int frames;
	void (*before_read)(struct chip_line *line); /* or NULL */
	unsigned char held[64]; /* bytes that are no whole request yet */
	size_t n_held;
	char path[64];
	int master;
	int slave; /* held open: else poll() returns at once, and the thread spins */
	pthread_t thread;
	atomic_bool stop;
};

/* As in the data sheet's C example: bit by bit, the byte shifted. */
static unsigned char chip_crc(const unsigned char *bytes, size_t n)
{
	unsigned char crc = 0;

	for (size_t i = 0; i < n; i++) {
		unsigned char byte = bytes[i];

		for (int j = 0; j < 8; j++) {
			if ((crc >> 7) ^ (byte & 1))
				crc = (unsigned char)(crc << 1) ^ 7;
			else
				crc = (unsigned char)(crc << 1);
			byte >>= 1;
		}
	}
	return crc;
}

static inline void chip_reset(struct chip_line *l, int node)
{
	for (int i = 0; i < 128; i++)
		l->reg[node][i] = 0;
	l->reg[node][0] = 0x1c1;
	l->reg[node][CHIP_GSTAT] = 1;
	l->reg[node][CHIP_IOIN] = 0x21000040;
	l->reg[node][CHIP_TSTEP] = 0xfffff;
	l->reg[node][CHIP_SG_RESULT] = 300;
	l->reg[node][CHIP_CHOPCONF] = 0x10000053;
	l->reg[node][CHIP_DRV_STATUS] = 0xc0000000;
	l->reg[node][0x70] = 0xc10d0024;
	l->nodes |= 1u << node;
}

static void chip_write(struct chip_line *l, int node, int reg, uint32_t value)
{
	uint32_t stuck = reg == CHIP_CHOPCONF ? l->chopconf_stuck : 0;

	if (reg == CHIP_GSTAT)
		l->reg[node][reg] &= ~value;
	else
		l->reg[node][reg] = (value & ~stuck) | (l->reg[node][reg] & stuck);
	l->reg[node][CHIP_IFCNT] = (l->reg[node][CHIP_IFCNT] + 1) & 255;
}

/* Obey a request of 4 or 8 bytes; the length of the answer. */
static size_t chip_obey(struct chip_line *l, const unsigned char *ask, size_t n,
			unsigned char answer[8])
{
	int node = ask[1], reg = ask[2] & 127;
	uint32_t value;

	if (chip_crc(ask, n - 1) != ask[n - 1] || node > 3 || !(l->nodes >> node & 1))
		return 0;
	if (l->deaf > 0) {
		l->deaf--;
		return 0;
	}
	if (n == 8 && l->lost_writes > 0) {
		l->lost_writes--;
		return 0;
	}
	if (n == 8) {
		chip_write(l, node, reg,
			   (uint32_t)ask[3] << 24 | (uint32_t)ask[4] << 16 |
				   (uint32_t)ask[5] << 8 | ask[6]);
		return 0;
	}
	if (l->before_read)
		l->before_read(l);
	value = l->reg[node][reg];
	memcpy(answer,
	       (unsigned char[]){5, 255, ask[2], (unsigned char)(value >> 24),
				 (unsigned char)(value >> 16),
				 (unsigned char)(value >> 8), (unsigned char)value},
	       7);
	answer[7] = chip_crc(answer, 7);
	if (l->garbled > 0) {
		l->garbled--;
		answer[5] ^= 0x10;
	}
	return 8;
}

static void chip_take(struct chip_line *l, const unsigned char *bytes, size_t n)
{
	unsigned char answer[8];

	memcpy(l->held + l->n_held, bytes, n);
	l->n_held += n;
	while (l->n_held >= 4) {
		size_t length = l->held[2] & 0x80 ? 8 : 4, m;

		if (l->n_held < length)
			return;
		if (l->frames < CHIP_FRAMES)
			memcpy(l->frame[l->frames++], l->held, length);
		m = chip_obey(l, l->held, length, answer);
		if (m && write(l->master, answer, m) != (ssize_t)m)
			return;
		l->n_held -= length;
		memmove(l->held, l->held + length, l->n_held);
	}
}

static void *chip_run(void *argument)
{
	struct chip_line *l = argument;

	while (!l->stop) {
		struct pollfd wait = {.fd = l->master, .events = POLLIN};
		unsigned char bytes[32];
		ssize_t n;

		poll(&wait, 1, 10);
		n = wait.revents & POLLIN ? read(l->master, bytes, sizeof(bytes)) : 0;
		if (n > 0 && !l->mute_echo && write(l->master, bytes, (size_t)n) != n)
			break;
		if (n > 0)
			chip_take(l, bytes, (size_t)n);
	}
	return NULL;
}

/* A line of zeroes, then with node 0; 0 or -1. */
static inline int chip_begin(struct chip_line *l)
{
	chip_reset(l, 0);
	l->master = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
	if (l->master < 0 || grantpt(l->master) || unlockpt(l->master) ||
	    ptsname_r(l->master, l->path, sizeof(l->path)))
		return -1;
	l->slave = open(l->path, O_RDWR | O_NOCTTY | O_CLOEXEC);
	if (l->slave < 0)
		return -1;
	return pthread_create(&l->thread, NULL, chip_run, l);
}

static inline void chip_end(struct chip_line *l)
{
	l->stop = true;
	pthread_join(l->thread, NULL);
	close(l->slave);
	close(l->master);
}

#endif
