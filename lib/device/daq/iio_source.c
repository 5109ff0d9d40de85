// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * An A/D converter of Linux IIO; see iio_source.h.
 */
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include "iio_source.h"

/* --- format --- */

int iio_format_of(struct iio_format *format, const struct iio_data_format *data,
		  unsigned int bits_max)
{
	unsigned int length = data->length;

	if ((length != 8 && length != 16 && length != 32 && length != 64) ||
	    !data->bits || data->bits > bits_max || data->bits > length ||
	    data->shift > length - data->bits || data->repeat > 1)
		return -EINVAL;
	*format = (struct iio_format){
		.bytes = length / 8,
		.bits = data->bits,
		.shift = data->shift,
		.is_signed = data->is_signed,
		.is_be = data->is_be,
	};
	return 0;
}

/* The bits at @at, shifted down; without regard to sign. */
static uint64_t raw_value(const struct iio_format *format, const void *at)
{
	const unsigned char *byte = at;
	uint64_t value = 0;

	for (unsigned int i = 0; i < format->bytes; i++)
		value = value << 8 | byte[format->is_be ? i : format->bytes - 1 - i];
	value >>= format->shift;
	return format->bits < 64 ? value & ((UINT64_C(1) << format->bits) - 1) : value;
}

/* The same as a code: 0 … 2^bits - 1, growing with the voltage. For bits up to 31. */
static int32_t code_of(const struct iio_format *format, const void *at)
{
	uint64_t value = raw_value(format, at);

	/* Two's complement with its top bit inverted is the number + 2^(bits-1). */
	if (format->is_signed)
		value ^= UINT64_C(1) << (format->bits - 1);
	return (int32_t)value;
}

/*
 * --- trigger ---
 *
 * An hrtimer trigger "incise-PID-N", made through configfs while a channel is open, on
 * kernels that have iio-trig-hrtimer loaded.
 */

#define OURS_MAX 16 /* of one process */

/* 0 and its name; -ENOENT (the kernel has none), -EACCES, -ENOSPC … */
static int make_trigger(const char *folder, char *name, size_t size)
{
	char path[PATH_MAX];

	for (int i = 0; i < OURS_MAX; i++) {
		snprintf(name, size, "incise-%ld-%d", (long)getpid(), i);
		snprintf(path, sizeof(path), "%s/%s", folder, name);
		if (!mkdir(path, 0755))
			return 0;
		if (errno != EEXIST)
			break;
	}
	name[0] = '\0';
	return -errno;
}

/* @name may be empty. */
static void remove_trigger(const char *folder, const char *name)
{
	char path[PATH_MAX];

	if (!*name)
		return;
	snprintf(path, sizeof(path), "%s/%s", folder, name);
	rmdir(path);
}

/* Remove triggers of processes that have ended. */
static void sweep_triggers(const char *folder)
{
	DIR *dir = opendir(folder);
	struct dirent *entry;
	int pid, number, end;

	while (dir && (entry = readdir(dir))) {
		end = 0;
		if (sscanf(entry->d_name, "incise-%9d-%2d%n", &pid, &number, &end) == 2 &&
		    !entry->d_name[end] && pid > 0 && kill(pid, 0) && errno == ESRCH)
			remove_trigger(folder, entry->d_name);
	}
	if (dir)
		closedir(dir);
}

/* --- rate --- */

#define KEY "sampling_frequency"
/* Accepted deviation from the requested rate: converters divide a clock. */
#define TOLERANCE 0.01

/* A device, or a channel of one. */
struct rate_place {
	const struct iio_device *device;
	const struct iio_channel *channel;
};

static bool has_rate(const struct rate_place *place)
{
	return place->channel ? iio_channel_find_attr(place->channel, KEY) != NULL
			      : place->device &&
					iio_device_find_attr(place->device, KEY) != NULL;
}

static int write_rate(const struct rate_place *place, double rate_hz)
{
	long long mHz = llround(rate_hz * 1e3);
	char text[40];
	ssize_t rc;

	/* Without "." where possible: some drivers take whole numbers only. */
	if (mHz % 1000)
		snprintf(text, sizeof(text), "%lld.%03lld", mHz / 1000, mHz % 1000);
	else
		snprintf(text, sizeof(text), "%lld", mHz / 1000);
	rc = place->channel ? iio_channel_attr_write(place->channel, KEY, text)
			    : iio_device_attr_write(place->device, KEY, text);
	return rc < 0 ? (int)rc : 0;
}

static double read_rate(const struct rate_place *place)
{
	double rate_hz = 0;
	int rc = place->channel
			 ? iio_channel_attr_read_double(place->channel, KEY, &rate_hz)
			 : iio_device_attr_read_double(place->device, KEY, &rate_hz);

	return rc < 0 || !isfinite(rate_hz) ? 0 : rate_hz;
}

/* "5000 10000 20000", or "unknown". */
static void read_available(const struct rate_place *place, char *text, size_t size)
{
	ssize_t rc = place->channel ? iio_channel_attr_read(place->channel,
							    KEY "_available", text, size)
				    : iio_device_attr_read(place->device,
							   KEY "_available", text, size);

	if (rc < 0)
		snprintf(text, size, "unknown");
	text[size - 1] = '\0';
}

/* @trigger: the one in use, or NULL. Sets s->rate_hz. */
static int set_rate(struct iio_source *s, const struct iio_device *trigger,
		    struct incise_error *err)
{
	struct rate_place of_trigger = {trigger, NULL}, own = {s->device, NULL},
			  *at = &own;
	double asked = s->setup.rate_hz;
	char known[160];
	int rc;

	if (!has_rate(&own))
		own.channel = s->voltage;
	if (has_rate(&of_trigger))
		at = &of_trigger;
	else if (!has_rate(&own))
		return incise_error_set(
			err, EOPNOTSUPP,
			"%s: neither %s nor its trigger has a rate; name a timer "
			"trigger in force_setup.trigger",
			s->where, iio_device_get_id(s->device));
	rc = write_rate(at, asked);
	if (rc == -EACCES)
		return incise_error_set(
			err, EACCES,
			"%s: no permission to set the rate of %s; join its group "
			"(udev/ has the rules), or be root",
			s->where, iio_device_get_id(at->device));
	s->rate_hz = read_rate(at);
	if (fabs(s->rate_hz - asked) > asked * TOLERANCE) {
		read_available(at, known, sizeof(known));
		return incise_error_set(
			err, EINVAL,
			"%s: %s does not support %.9g Hz%s%s and runs at %.9g Hz; set "
			"force_setup.rate_hz (available: %s)",
			s->where, iio_device_get_id(at->device), asked, rc ? ": " : "",
			rc ? strerror(-rc) : "", s->rate_hz, known);
	}
	/* A trigger cannot be faster than the converter's own rate. */
	if (at == &own || !has_rate(&own))
		return 0;
	write_rate(&own, asked);
	if (read_rate(&own) < s->rate_hz * (1 - TOLERANCE)) {
		read_available(&own, known, sizeof(known));
		return incise_error_set(
			err, EINVAL,
			"%s: %s converts at %.9g Hz, its trigger at %.9g Hz; set "
			"force_setup.rate_hz (available: %s)",
			s->where, iio_device_get_id(s->device), read_rate(&own),
			s->rate_hz, known);
	}
	return 0;
}

/* --- set-up --- */

#define CODE_BITS_MAX 31 /* of incise_force_sample.code */

bool iio_source_can_sample(const struct iio_channel *channel)
{
	return !iio_channel_is_output(channel) && iio_channel_is_scan_element(channel) &&
	       !strncmp(iio_channel_get_id(channel), "voltage", 7);
}

/* "voltage0", or "voltage0_force" of a channel with a name. */
static void print_channel(const struct iio_channel *channel, char *text, size_t size)
{
	const char *name = iio_channel_get_name(channel);

	snprintf(text, size, "%.60s%s%.60s", iio_channel_get_id(channel), name ? "_" : "",
		 name ? name : "");
}

void iio_source_list_channels(const struct iio_device *device, char *text, size_t size)
{
	unsigned int n = iio_device_get_channels_count(device);
	size_t used = 0;

	snprintf(text, size, "none");
	for (unsigned int i = 0; i < n && used + 2 < size; i++) {
		const struct iio_channel *c = iio_device_get_channel(device, i);

		if (!iio_source_can_sample(c))
			continue;
		used += (size_t)snprintf(text + used, size - used, used ? ", " : "");
		print_channel(c, text + used, size - used);
		used += strlen(text + used);
	}
}

/*
 * The channel whose id is @name, else the only difference of that input and another one, else the
 * one that is printed so; NULL: none, or several.
 */
static struct iio_channel *find_named(const struct iio_device *device, const char *name)
{
	unsigned int n = iio_device_get_channels_count(device);
	size_t length = strlen(name);
	struct iio_channel *found = NULL;
	int best = 0, count = 0;
	char printed[130];

	for (unsigned int i = 0; i < n; i++) {
		struct iio_channel *c = iio_device_get_channel(device, i);
		const char *id = iio_channel_get_id(c);
		int fit = !iio_source_can_sample(c) || strncmp(id, name, length) ? 0
			  : id[length] ? id[length] == '-'
				       : 2;

		if (!fit || fit < best)
			continue;
		count = fit > best ? 1 : count + 1;
		best = fit;
		found = c;
	}
	for (unsigned int i = 0; i < n && count != 1; i++) {
		found = iio_device_get_channel(device, i);
		print_channel(found, printed, sizeof(printed));
		count = iio_source_can_sample(found) && !strcmp(printed, name) ? 1 : 0;
	}
	return count == 1 ? found : NULL;
}

static struct iio_channel *find_voltage(const struct iio_device *device, int channel)
{
	char name[24];

	snprintf(name, sizeof(name), "voltage%d", channel);
	return find_named(device, name);
}

bool iio_source_volts(const struct iio_channel *channel, const struct iio_format *format,
		      double *full_scale_V, double *offset_V)
{
	double scale_mV = 0, offset = 0;

	if (iio_channel_attr_read_double(channel, "scale", &scale_mV) < 0 ||
	    !isfinite(scale_mV) || scale_mV <= 0)
		return false;
	if (iio_channel_attr_read_double(channel, "offset", &offset) < 0 ||
	    !isfinite(offset))
		offset = 0;
	/* Codes of a signed channel are moved up by half the range. */
	if (format->is_signed)
		offset -= ldexp(1, (int)format->bits - 1);
	*full_scale_V = ldexp(scale_mV, (int)format->bits) / 1e3;
	*offset_V = offset * scale_mV / 1e3;
	return true;
}

/* All devices, or all triggers: "incise-sim-adc (iio:device0), …". */
static void list_iio_source(const struct iio_context *context, bool triggers, char *text,
			    size_t size)
{
	unsigned int n = iio_context_get_devices_count(context);
	size_t used = 0;

	text[0] = '\0';
	for (unsigned int i = 0; i < n && used < size; i++) {
		const struct iio_device *device = iio_context_get_device(context, i);
		const char *name = iio_device_get_name(device);

		if (iio_device_is_trigger(device) != triggers)
			continue;
		used += (size_t)snprintf(text + used, size - used, "%s%s (%s)",
					 used ? ", " : "", name ? name : "?",
					 iio_device_get_id(device));
	}
	if (!*text)
		snprintf(text, size, "none");
}

static int find_device(struct iio_source *s, const char *name, struct incise_error *err)
{
	char known[200];

	s->context = iio_create_local_context();
	if (!s->context)
		return incise_error_set(
			err, errno ? errno : ENODEV,
			"%s: this kernel has no IIO devices: %s; load the driver of "
			"your converter",
			s->where, strerror(errno));
	s->device = iio_context_find_device(s->context, name);
	if (s->device && !iio_device_is_trigger(s->device))
		return 0;
	list_iio_source(s->context, false, known, sizeof(known));
	return incise_error_set(err, ENODEV,
				"%s: no such IIO device \"%.60s\"; there are: %s",
				s->where, name, known);
}

/* @what: "set the rate". */
static int refused_iio_source(const struct iio_source *s, int rc, const char *what,
			      struct incise_error *err)
{
	const char *id = iio_device_get_id(s->device);

	if (rc == -EACCES || rc == -EPERM)
		return incise_error_set(err, EACCES,
					"%s: no permission to %s of %s; join its group "
					"(udev/ has the rules), or be root",
					s->where, what, id);
	if (rc == -EBUSY)
		return incise_error_set(err, EBUSY,
					"%s: %s is in use by another program; end it",
					s->where, id);
	return incise_error_set(err, -rc, "%s: cannot %s of %s: %s", s->where, what, id,
				strerror(-rc));
}

/*
 * The file of a device opens only once at a time, which shows whether another program
 * samples. A buffer left running by a killed program is stopped, as it would block
 * settings. The file stays open for reading samples.
 */
static int check_alone(struct iio_source *s, struct incise_error *err)
{
	char path[80];

	snprintf(path, sizeof(path), "/dev/%.60s", iio_device_get_id(s->device));
	s->fd = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
	if (s->fd < 0)
		return refused_iio_source(s, -errno, "open the file", err);
	if (iio_device_buffer_attr_write(s->device, "enable", "0") == -EACCES)
		return refused_iio_source(s, -EACCES, "change the settings", err);
	return 0;
}

static int take_channels(struct iio_source *s, struct incise_error *err)
{
	const char *id = iio_device_get_id(s->device), *name = s->setup.channel_name;
	const struct iio_data_format *data;
	char known[200], number[16];

	s->voltage = *name ? find_named(s->device, name)
			   : find_voltage(s->device, s->setup.channel);
	if (!s->voltage) {
		iio_source_list_channels(s->device, known, sizeof(known));
		snprintf(number, sizeof(number), "%d", s->setup.channel);
		return incise_error_set(
			err, ENODEV,
			"%s: channel %s is no single channel of %s; set "
			"force_setup.channel to one of these, in quotes: %s",
			s->where, *name ? name : number, id, known);
	}
	if (s->setup.reference)
		return incise_error_set(err, EINVAL,
					"%s: only comedi has force_setup.reference; name "
					"an input or a difference of two in "
					"force_setup.channel",
					s->where);
	s->timestamp = iio_device_find_channel(s->device, "timestamp", false);
	if (!s->timestamp || !iio_channel_is_scan_element(s->timestamp) ||
	    iio_format_of(&s->timestamp_format, iio_channel_get_data_format(s->timestamp),
			  64))
		return incise_error_set(
			err, EOPNOTSUPP,
			"%s: %s has no timestamps in its buffer, so losses cannot be "
			"detected; use another converter",
			s->where, id);
	data = iio_channel_get_data_format(s->voltage);
	if (iio_format_of(&s->format, data, CODE_BITS_MAX))
		return incise_error_set(
			err, EOPNOTSUPP,
			"%s: samples of %s are %u bits of %u, shifted by %u, "
			"%u-fold: only 1 to %d bits of 8, 16, 32 or 64, once, are "
			"read",
			s->where, id, data->bits, data->length, data->shift, data->repeat,
			CODE_BITS_MAX);
	return 0;
}

static int set_clock(struct iio_source *s, struct incise_error *err)
{
	static const char key[] = "current_timestamp_clock";
	char is[40] = "";
	ssize_t rc = iio_device_attr_write(s->device, key, "monotonic");

	if (rc < 0)
		return refused_iio_source(s, (int)rc, "set the clock of timestamps", err);
	rc = iio_device_attr_read(s->device, key, is, sizeof(is));
	/*
	 * Linux 6.1 adds a NUL behind the end of the line; libiio removes only one of the
	 * two.
	 */
	is[strcspn(is, "\n")] = '\0';
	if (rc < 0 || strcmp(is, "monotonic") != 0)
		return incise_error_set(
			err, EOPNOTSUPP,
			"%s: timestamps of %s remain on the clock \"%s\" and cannot be "
			"compared with the tracker's; use another converter",
			s->where, iio_device_get_id(s->device), is);
	return 0;
}

static int set_volts(struct iio_source *s, struct incise_error *err)
{
	s->has_scale =
		iio_source_volts(s->voltage, &s->format, &s->full_scale_V, &s->offset_V);
	if (s->has_scale)
		return 0;
	if (s->setup.full_scale_V <= 0)
		return incise_error_set(
			err, EINVAL,
			"%s: the driver of %s does not report the scale of its codes; "
			"set force_setup.full_scale_V",
			s->where, iio_device_get_id(s->device));
	s->full_scale_V = s->setup.full_scale_V;
	s->offset_V = s->format.is_signed ? -s->full_scale_V / 2 : 0;
	return 0;
}

/* 0 or a negative errno. */
static int use_trigger(struct iio_source *s, const char *name)
{
	struct iio_device *trigger = iio_context_find_device(s->context, name);
	int rc;

	if (!trigger || !iio_device_is_trigger(trigger))
		return -ENODEV;
	rc = iio_device_set_trigger(s->device, trigger);
	if (rc < 0)
		return rc;
	s->trigger_set = true;
	snprintf(s->trigger_used, sizeof(s->trigger_used), "%s", name);
	return 0;
}

static int use_named(struct iio_source *s, struct incise_error *err)
{
	char known[200];
	int rc = use_trigger(s, s->setup.trigger);

	if (rc == -ENODEV) {
		list_iio_source(s->context, true, known, sizeof(known));
		return incise_error_set(err, ENODEV,
					"%s: no such trigger \"%s\"; there are: %s",
					s->where, s->setup.trigger, known);
	}
	if (rc == -EINVAL)
		return incise_error_set(err, EINVAL,
					"%s: %s does not accept the trigger \"%s\"; "
					"remove force_setup.trigger",
					s->where, iio_device_get_id(s->device),
					s->setup.trigger);
	return rc ? refused_iio_source(s, rc, "set the trigger", err) : 0;
}

/* The trigger named in rig.conf, our own, or the trigger already set. */
static int set_trigger(struct iio_source *s, struct incise_error *err)
{
	static const char key[] = "trigger/current_trigger";
	bool has = iio_device_attr_read(s->device, key, s->trigger_before,
					sizeof(s->trigger_before)) >= 0;

	if (*s->setup.trigger)
		return use_named(s, err);
	if (!has)
		return 0;
	if (*s->trigger && !use_trigger(s, s->trigger)) {
		sweep_triggers(s->trigger_folder);
		return 0;
	}
	/* The device takes only its own trigger. */
	remove_trigger(s->trigger_folder, s->trigger);
	*s->trigger = '\0';
	if (!*s->trigger_before && s->trigger_refused)
		return incise_error_set(
			err, EACCES,
			"%s: no trigger for %s, and no permission to make one; as "
			"root: mkdir %s/incise, then set force_setup.trigger = "
			"\"incise\"",
			s->where, iio_device_get_id(s->device), s->trigger_folder);
	if (!*s->trigger_before)
		return incise_error_set(
			err, ENODEV,
			"%s: no trigger for %s; run `modprobe iio-trig-hrtimer` if the "
			"kernel has it, or set force_setup.trigger",
			s->where, iio_device_get_id(s->device));
	snprintf(s->trigger_used, sizeof(s->trigger_used), "%s", s->trigger_before);
	return 0;
}

/* Make a trigger and a new context: a context shows only what existed before it. */
static int with_own_trigger(struct iio_source *s, const char *name,
			    struct incise_error *err)
{
	char before[64];
	int rc;

	if (*s->setup.trigger ||
	    iio_device_attr_read(s->device, "trigger/current_trigger", before,
				 sizeof(before)) < 0)
		return 0;
	rc = make_trigger(s->trigger_folder, s->trigger, sizeof(s->trigger));
	s->trigger_refused = rc == -EACCES || rc == -EPERM;
	if (rc)
		return 0;
	iio_context_destroy(s->context);
	s->context = NULL;
	return find_device(s, name, err);
}

int iio_source_open(struct iio_source *s, const char *name, struct incise_error *err)
{
	const struct iio_device *trigger;
	int rc = find_device(s, name, err);

	rc = rc ? rc : check_alone(s, err);
	rc = rc ? rc : with_own_trigger(s, name, err);
	rc = rc ? rc : take_channels(s, err);
	rc = rc ? rc : set_clock(s, err);
	rc = rc ? rc : set_trigger(s, err);
	if (rc)
		return rc;
	trigger = *s->trigger_used ? iio_context_find_device(s->context, s->trigger_used)
				   : NULL;
	rc = set_rate(s, trigger, err);
	/* The rate sets the scale of some converters. */
	return rc ? rc : set_volts(s, err);
}

bool iio_source_changed(const struct iio_source *s)
{
	double full_scale_V, offset_V;

	return s->has_scale &&
	       iio_source_volts(s->voltage, &s->format, &full_scale_V, &offset_V) &&
	       (full_scale_V != s->full_scale_V || offset_V != s->offset_V);
}

void iio_source_close(struct iio_source *s)
{
	if (s->trigger_set) {
		/* An empty line takes it off. */
		const char *before = *s->trigger_before ? s->trigger_before : "\n";

		s->trigger_set =
			iio_device_attr_write(s->device, "trigger/current_trigger",
					      before) < 0; /* the device is gone */
	}
	if (s->context)
		iio_context_destroy(s->context);
	if (s->fd >= 0)
		close(s->fd);
	remove_trigger(s->trigger_folder, s->trigger);
}

/* --- buffer --- */

static int write_text(const char *folder, const char *name, const char *text)
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

static int write_number(const char *folder, const char *name, unsigned int number)
{
	char text[16];

	snprintf(text, sizeof(text), "%u", number);
	return write_text(folder, name, text);
}

/* Remove all channels from the scan: those left by others would move ours. */
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
			write_text(path, entry->d_name, "0");
	}
	if (dir)
		closedir(dir);
}

static int enable(const char *folder, const struct iio_channel *channel)
{
	char name[130], file[200];

	print_channel(channel, name, sizeof(name));
	snprintf(file, sizeof(file), "scan_elements/in_%s_en", name);
	return write_text(folder, file, "1");
}

static size_t round_up(size_t at, size_t size)
{
	return (at + size - 1) / size * size;
}

static void lay_out(struct iio_source *s)
{
	bool timestamp_first =
		iio_channel_get_index(s->timestamp) < iio_channel_get_index(s->voltage);
	size_t voltage = s->format.bytes, timestamp = s->timestamp_format.bytes;

	s->voltage_at = timestamp_first ? round_up(timestamp, voltage) : 0;
	s->timestamp_at = timestamp_first ? 0 : round_up(voltage, timestamp);
	s->step = timestamp_first ? s->voltage_at + voltage : s->timestamp_at + timestamp;
	s->step = round_up(s->step, voltage > timestamp ? voltage : timestamp);
}

int iio_source_start(struct iio_source *s, const char *folder, unsigned int block,
		     unsigned int capacity)
{
	int rc;

	lay_out(s);
	clear_scan(folder);
	rc = enable(folder, s->voltage);
	rc = rc ? rc : enable(folder, s->timestamp);
	rc = rc ? rc : write_number(folder, "buffer/length", capacity);
	if (rc)
		return rc;
	/* A buffer without a watermark only wakes its reader more often. */
	write_number(folder, "buffer/watermark", block);
	snprintf(s->folder, sizeof(s->folder), "%s", folder);
	rc = write_text(folder, "buffer/enable", "1");
	if (rc)
		iio_source_stop(s);
	return rc;
}

void iio_source_stop(struct iio_source *s)
{
	if (!*s->folder)
		return;
	write_text(s->folder, "buffer/enable", "0");
	clear_scan(s->folder);
	s->folder[0] = '\0';
}

int iio_source_read(struct iio_source *s)
{
	ssize_t got = read(s->fd, s->bytes, sizeof(s->bytes) / s->step * s->step);

	if (got < 0)
		return -errno;
	/* The kernel returns whole scans; an empty read is no answer of a device. */
	return (size_t)got >= s->step ? (int)((size_t)got / s->step) : -EIO;
}

int32_t iio_source_code(const struct iio_source *s, int i)
{
	return code_of(&s->format, s->bytes + (size_t)i * s->step + s->voltage_at);
}

int64_t iio_source_timestamp(const struct iio_source *s, int i)
{
	return (int64_t)raw_value(&s->timestamp_format,
				  s->bytes + (size_t)i * s->step + s->timestamp_at);
}
