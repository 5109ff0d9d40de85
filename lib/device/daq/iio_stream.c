// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The buffer of an IIO device; see iio_stream.h.
 */
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>
#include "iio_stream.h"

static int put(const char *folder, const char *name, const char *text)
{
	char path[PATH_MAX];
	int fd, rc = 0;

	snprintf(path, sizeof(path), "%s/%s", folder, name);
	fd = open(path, O_WRONLY | O_CLOEXEC);
	if (fd < 0)
		return -errno;
	if (write(fd, text, strlen(text)) < 0)
		rc = -errno;
	close(fd);
	return rc;
}

static int put_number(const char *folder, const char *name, unsigned int number)
{
	char text[16];

	snprintf(text, sizeof(text), "%u", number);
	return put(folder, name, text);
}

/* All channels out of the scan: what others left in it would move ours. */
static void clear_scan(const char *folder)
{
	char path[PATH_MAX];
	struct dirent *entry;
	DIR *dir;

	snprintf(path, sizeof(path), "%s/scan_elements", folder);
	dir = opendir(path);
	while (dir && (entry = readdir(dir))) {
		size_t length = strlen(entry->d_name);

		if (length > 3 && !strcmp(entry->d_name + length - 3, "_en"))
			put(path, entry->d_name, "0");
	}
	if (dir)
		closedir(dir);
}

/* "voltage0", or "voltage0_force" of one that has a name. */
static int enable(const char *folder, const struct iio_channel *channel)
{
	const char *name = iio_channel_get_name(channel);
	char file[200];

	snprintf(file, sizeof(file), "scan_elements/in_%.60s%s%.60s_en",
		 iio_channel_get_id(channel), name ? "_" : "", name ? name : "");
	return put(folder, file, "1");
}

static size_t round_up(size_t at, size_t size)
{
	return (at + size - 1) / size * size;
}

static void lay_out(struct iio_stream *s, const struct iio_source *source)
{
	bool stamp_first = iio_channel_get_index(source->stamp) <
			   iio_channel_get_index(source->voltage);
	size_t voltage = source->format.bytes, stamp = source->stamp_format.bytes;

	s->voltage = source->format;
	s->stamp = source->stamp_format;
	s->voltage_at = stamp_first ? round_up(stamp, voltage) : 0;
	s->stamp_at = stamp_first ? 0 : round_up(voltage, stamp);
	s->step = stamp_first ? s->voltage_at + voltage : s->stamp_at + stamp;
	s->step = round_up(s->step, voltage > stamp ? voltage : stamp);
}

int iio_stream_start(struct iio_stream *s, const struct iio_source *source,
		     const char *folder, unsigned int block, unsigned int room)
{
	int rc;

	lay_out(s, source);
	clear_scan(folder);
	rc = enable(folder, source->voltage);
	rc = rc ? rc : enable(folder, source->stamp);
	rc = rc ? rc : put_number(folder, "buffer/length", room);
	if (rc)
		return rc;
	/* A buffer without a watermark wakes its reader more often: that is all. */
	put_number(folder, "buffer/watermark", block);
	snprintf(s->folder, sizeof(s->folder), "%s", folder);
	rc = put(folder, "buffer/enable", "1");
	if (rc)
		iio_stream_stop(s);
	return rc;
}

void iio_stream_stop(struct iio_stream *s)
{
	if (!*s->folder)
		return;
	put(s->folder, "buffer/enable", "0");
	clear_scan(s->folder);
	s->folder[0] = '\0';
}

int iio_stream_read(struct iio_stream *s)
{
	ssize_t got = read(s->fd, s->bytes, sizeof(s->bytes) / s->step * s->step);

	if (got < 0)
		return -errno;
	/* The kernel hands over whole scans. Nothing at all is no answer of a device. */
	return (size_t)got >= s->step ? (int)((size_t)got / s->step) : -EIO;
}

int32_t iio_stream_code(const struct iio_stream *s, int i)
{
	return iio_format_code(&s->voltage,
			       s->bytes + (size_t)i * s->step + s->voltage_at);
}

int64_t iio_stream_stamp(const struct iio_stream *s, int i)
{
	return (int64_t)iio_format_raw(&s->stamp,
				       s->bytes + (size_t)i * s->step + s->stamp_at);
}
