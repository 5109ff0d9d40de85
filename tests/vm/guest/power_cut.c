// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * What a disk holds after a power cut, out of the log of dm-log-writes.
 *
 *     mark NAME              write the time, CLOCK_MONOTONIC in ns, into the log of device NAME each 7 ms
 *     marks LOG              print how many of them the log has
 *     cut LOG DISK N SEED    write to DISK what it has at mark N, and print the mark's time
 *
 *     log    w w F w M w w w F     w  write    F  flush: what is before it is on the disk
 *            ├─────┤ │ ┊ ┊ ┊       M  mark N
 *             on it  ▼ each of these is, or is not
 *
 * The log keeps a write back until a flush is told to the disk, so those behind the mark may have come before it.
 */
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <linux/dm-ioctl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>

#define MAGIC 0x6a736677736872ULL
#define FLUSH 1
#define DISCARD 4
#define MARK 8
#define BETWEEN_NS 7000000 /* not a part of the 100 ms of a commit */
#define DATA_MAX (16 << 20)

/* On the disk, little-endian. */
struct super {
	uint64_t magic, version, entries;
	uint32_t sector_bytes;
};

struct entry {
	uint64_t sector, sectors, flags, data_bytes;
};

static char data[DATA_MAX];

static void die(const char *what)
{
	fprintf(stderr, "power_cut: %s: %s\n", what, strerror(errno));
	exit(1);
}

/* --- mark --------------------------------------------------------------------------------- */

static void send_mark(int control, const char *name, long long t_ns)
{
	union {
		struct dm_ioctl head;
		char bytes[1024];
	} to = {.head = {.version = {4, 0, 0}, .data_size = sizeof(to)}};
	struct dm_target_msg *message = (void *)(to.bytes + sizeof(to.head));

	to.head.data_start = sizeof(to.head);
	snprintf(to.head.name, sizeof(to.head.name), "%s", name);
	sprintf(message->message, "mark %lld", t_ns);
	if (ioctl(control, DM_TARGET_MSG, &to))
		die("mark");
}

static void mark(const char *name)
{
	const struct timespec between = {.tv_nsec = BETWEEN_NS};
	int control = open("/dev/mapper/control", O_RDWR);
	struct timespec now;

	if (control < 0)
		die("/dev/mapper/control");
	for (;; nanosleep(&between, NULL)) {
		clock_gettime(CLOCK_MONOTONIC, &now);
		send_mark(control, name, now.tv_sec * 1000000000LL + now.tv_nsec);
	}
}

/* --- the log ------------------------------------------------------------------------------ */

struct log {
	int fd;
	struct super super;
	uint64_t at; /* byte of the next entry */
	uint64_t n;  /* entries read */
	struct entry entry;
	uint64_t data_at;
};

static void read_at(const struct log *log, void *to, size_t size, uint64_t at)
{
	if (pread(log->fd, to, size, (off_t)at) != (ssize_t)size)
		die("the log is short");
}

static void open_log(struct log *log, const char *path)
{
	*log = (struct log){.fd = open(path, O_RDONLY)};
	if (log->fd < 0)
		die(path);
	read_at(log, &log->super, sizeof(log->super), 0);
	if (log->super.magic != MAGIC || !log->super.sector_bytes)
		die("no log");
	log->at = log->super.sector_bytes;
}

static int next_entry(struct log *log)
{
	if (log->n++ == log->super.entries)
		return 0;
	read_at(log, &log->entry, sizeof(log->entry), log->at);
	log->data_at = log->at + log->super.sector_bytes;
	log->at = log->data_at;
	if (!(log->entry.flags & (DISCARD | MARK)))
		log->at += log->entry.sectors * log->super.sector_bytes;
	return 1;
}

static void write_entry(const struct log *log, int disk)
{
	const size_t size = log->entry.sectors * log->super.sector_bytes;
	const off_t to = (off_t)(log->entry.sector * log->super.sector_bytes);

	if (size > DATA_MAX)
		die("a write of more than 16 MiB");
	if (log->entry.flags & DISCARD)
		return; /* the old bytes, or any: these are the old ones */
	read_at(log, data, size, log->data_at);
	if (pwrite(disk, data, size, to) != (ssize_t)size)
		die("the disk");
}

static long long time_of(const struct log *log)
{
	char text[32] = "";

	read_at(log, text, sizeof(text) - 1,
		log->data_at - log->super.sector_bytes + sizeof(log->entry));
	return atoll(text);
}

static long count_marks(const char *path)
{
	struct log log;
	long n = 0;

	open_log(&log, path);
	while (next_entry(&log))
		n += !!(log.entry.flags & MARK);
	return n;
}

/* What is beyond the mark, up to the flush that comes next, is on the disk by chance. */
static long long cut(const char *path, const char *to, long n, unsigned int seed)
{
	int disk = open(to, O_WRONLY);
	long long t_ns = -1;
	struct log log;

	if (disk < 0)
		die(to);
	open_log(&log, path);
	srandom(seed);
	while (next_entry(&log)) {
		if (log.entry.flags & MARK) {
			if (t_ns < 0 && n-- == 0)
				t_ns = time_of(&log);
			continue;
		}
		if (t_ns >= 0 && (log.entry.flags & FLUSH))
			break;
		if (t_ns < 0 || random() & 0x4000)
			write_entry(&log, disk);
	}
	if (t_ns < 0)
		die("no such mark");
	if (close(disk))
		die(to);
	return t_ns;
}

int main(int argc, char **argv)
{
	if (argc == 3 && !strcmp(argv[1], "mark"))
		mark(argv[2]);
	else if (argc == 3 && !strcmp(argv[1], "marks"))
		printf("%ld\n", count_marks(argv[2]));
	else if (argc == 6 && !strcmp(argv[1], "cut"))
		printf("%lld\n",
		       cut(argv[2], argv[3], atol(argv[4]), (unsigned int)atoi(argv[5])));
	else
		return 2;
	return 0;
}
