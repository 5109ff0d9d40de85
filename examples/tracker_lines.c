// SPDX-License-Identifier: GPL-2.0-or-later
/* A tracker that writes a line per sample into a FIFO: x y z in mm, or x y z and a unit
 * quaternion, w first. rig.conf: tracker = "lines:PATH:RATE"; RATE is 120 Hz by default. */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <incise/backend.h>

struct lines {
	struct incise_tracker tracker; /* must be the first member */
	struct incise_clock *clock;
	int fd;
	double rate_hz;
	uint64_t seq, lost;
	char text[4096]; /* received, not yet parsed */
	size_t length;
	bool away; /* no writer: the next sample is a restart */
	char path[200];
};

/* "PATH" or "PATH:RATE" */
static int parse(const char *arguments, char *path, size_t size, double *rate_hz)
{
	const char *colon = strrchr(arguments, ':');
	char *end = "";

	*rate_hz = 120.0;
	if (colon)
		*rate_hz = strtod(colon + 1, &end);
	if ((size_t)snprintf(path, size, "%.*s",
			     colon ? (int)(colon - arguments) : (int)strlen(arguments),
			     arguments) >= size)
		return -EINVAL;
	return *path && !*end && *rate_hz >= 1.0 && *rate_hz <= 1000.0 ? 0 : -EINVAL;
}

/* Input is untrusted: accept only valid poses. */
static bool pose(const char *line, struct incise_tracker_sample *sample)
{
	double *x = sample->position_mm, *q = sample->quaternion, norm = 0.0;
	int end = 0, n = sscanf(line, "%lf %lf %lf %n%lf %lf %lf %lf %n", x, x + 1, x + 2,
				&end, q, q + 1, q + 2, q + 3, &end);

	if (n == 3)
		memcpy(q, (double[]){1.0, 0.0, 0.0, 0.0}, sizeof(sample->quaternion));
	for (int i = 0; i < 4; i++)
		norm += q[i] * q[i];
	for (int i = 0; i < 3; i++)
		norm += fabs(x[i]) <= 1e6 ? 0.0 : NAN;
	return (n == 3 || n == 7) && !line[end] && fabs(norm - 1.0) < 1e-3;
}

/* Parse one line: a sample, or a lost one. */
static bool take(struct lines *lines, const char *line, int64_t now_ns,
		 struct incise_tracker_sample *sample)
{
	*sample = (struct incise_tracker_sample){.status = ' ', .station = 1};
	sample->t_ns = now_ns;
	sample->seq = lines->seq++;
	if (!pose(line, sample)) {
		lines->lost++;
		return false;
	}
	sample->restarted = lines->away;
	lines->away = false;
	return true;
}

static int lines_read(struct incise_tracker *tracker,
		      struct incise_tracker_sample *samples, int n)
{
	struct lines *lines = (struct lines *)tracker;
	ssize_t got = read(lines->fd, lines->text + lines->length,
			   sizeof(lines->text) - lines->length);
	int64_t now_ns = incise_clock_now(lines->clock);
	char *line = lines->text, *end;
	int taken = 0;

	if (got < 0 && errno != EAGAIN && errno != EINTR)
		return -EIO;
	if (got == 0 && lines->length < sizeof(lines->text))
		lines->away = true;
	lines->length += got > 0 ? (size_t)got : 0;
	while (taken < n &&
	       (end = memchr(line, '\n', lines->length - (size_t)(line - lines->text)))) {
		*end = '\0';
		taken += take(lines, line, now_ns, &samples[taken]);
		line = end + 1;
	}
	lines->length -= (size_t)(line - lines->text);
	memmove(lines->text, line, lines->length);
	if (lines->length == sizeof(lines->text) &&
	    !memchr(lines->text, '\n', lines->length)) {
		lines->length = 0; /* line too long: count it as lost */
		lines->lost++;
		lines->seq++;
	}
	return taken;
}

static void lines_info(const struct incise_tracker *tracker,
		       struct incise_tracker_info *info)
{
	const struct lines *lines = (const struct lines *)tracker;

	*info = (struct incise_tracker_info){.rate_hz = lines->rate_hz, .stations = 1};
	snprintf(info->name, sizeof(info->name), "lines of %.50s", lines->path);
}

static uint64_t lines_lost(const struct incise_tracker *tracker)
{
	return ((const struct lines *)tracker)->lost;
}

static void lines_close(struct incise_tracker *tracker)
{
	struct lines *lines = (struct lines *)tracker;

	close(lines->fd);
	free(lines);
}

static const struct incise_tracker_ops ops = {
	.read = lines_read, .info = lines_info, .lost = lines_lost, .close = lines_close};

static void *lines_open(const struct incise_backend_request *request,
			struct incise_error *err)
{
	struct lines *lines = calloc(1, sizeof(*lines));
	struct stat status;

	if (!lines) {
		incise_error_set(err, ENOMEM, "%s: no memory", request->where);
		return NULL;
	}
	lines->tracker.ops = &ops;
	lines->clock = request->clock;
	lines->away = true;
	if (parse(request->arguments, lines->path, sizeof(lines->path),
		  &lines->rate_hz)) {
		incise_error_set(
			err, EINVAL,
			"%s: \"lines:%s\" is not lines:PATH:RATE with a rate of 1 to 1000 Hz",
			request->where, request->arguments);
		goto free;
	}
	lines->fd = open(lines->path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
	if (lines->fd < 0) {
		incise_error_set(err, errno, "%s: %s: %s; create it with mkfifo",
				 request->where, lines->path, strerror(errno));
		goto free;
	}
	if (!fstat(lines->fd, &status) && S_ISFIFO(status.st_mode))
		return lines;
	close(lines->fd);
	incise_error_set(err, EINVAL, "%s: %s is not a FIFO; create one with mkfifo",
			 request->where, lines->path);
free:
	free(lines);
	return NULL;
}

/* For `incise info lines:PATH`. Without arguments there is nothing to list. */
static int lines_scan(const char *arguments, incise_scan_found *found, void *context,
		      struct incise_error *err)
{
	struct incise_scan_device device = {0};
	struct stat status;
	char path[200];
	double rate_hz;

	if (!*arguments)
		return 0;
	if (parse(arguments, path, sizeof(path), &rate_hz))
		return incise_error_set(err, EINVAL, "lines:%s is not lines:PATH:RATE",
					arguments);
	if (stat(path, &status))
		return incise_error_set(err, ENODEV,
					"lines:%s: %s; create it with mkfifo", arguments,
					strerror(errno));
	device.usable = S_ISFIFO(status.st_mode);
	snprintf(device.device, sizeof(device.device), "lines:%s:%g", path, rate_hz);
	snprintf(device.what, sizeof(device.what), "%s",
		 device.usable ? "FIFO; the writer cannot be queried" : "not a FIFO");
	incise_scan_tell(&device, "rate_hz", "%g", rate_hz);
	return found(context, &device);
}

const struct incise_backend incise_backend = {
	.abi = INCISE_BACKEND_ABI,
	.kind = "tracker",
	.name = "lines",
	.open = lines_open,
	.scan = lines_scan,
};
