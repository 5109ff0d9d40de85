// SPDX-License-Identifier: GPL-2.0-only
/*
 * The converter: takes samples of the waveform and stores them for the thread,
 * and the files by which a test feeds it and accounts for every sample. See
 * incise_sim.h for the files "adc/waveform", "adc/control", "adc/status".
 */
#include <linux/debugfs.h>
#include <linux/fs.h>
#include <linux/module.h>
#include <linux/seq_file.h>
#include <linux/slab.h>
#include <linux/uaccess.h>
#include <linux/vmalloc.h>

#include "adc.h"
#include "sim.h"

/* Samples that a write takes at once; the rest is for the next write. */
#define SIM_WAVEFORM_CHUNK 4096U

/* Indices are masked and wrap after 2^32: powers of two. */
static_assert((INCISE_SIM_ADC_WAVEFORM & (INCISE_SIM_ADC_WAVEFORM - 1)) == 0);
static_assert((SIM_ADC_FIFO & (SIM_ADC_FIFO - 1)) == 0);

static u16 *sim_waveform_at(struct sim_waveform *waveform, u32 index)
{
	return &waveform->sample[index & (INCISE_SIM_ADC_WAVEFORM - 1)];
}

/* The next sample, or false without one. */
static bool sim_waveform_next(struct sim_waveform *waveform, u16 *value)
{
	/* acquire: pairs with the release in sim_waveform_write() */
	u32 size = smp_load_acquire(&waveform->head) - waveform->tail;

	if (!size)
		return false;
	if (!waveform->repeat) {
		*value = *sim_waveform_at(waveform, waveform->tail);
		/* release: read before the writer may overwrite */
		smp_store_release(&waveform->tail, waveform->tail + 1);
		return true;
	}
	if (waveform->cursor >= size)
		waveform->cursor = 0;
	*value = *sim_waveform_at(waveform, waveform->tail + waveform->cursor++);
	return true;
}

static u16 sim_adc_convert_locked(struct sim_adc *adc)
{
	adc->conversions++;
	if (!sim_waveform_next(&adc->waveform, &adc->value))
		adc->underruns++;
	return adc->value;
}

/* One conversion by itself, as a read of in_voltage0_raw does it. */
u16 sim_adc_convert(struct sim_adc *adc)
{
	unsigned long flags;
	u16 value;

	raw_spin_lock_irqsave(&adc->lock, flags);
	value = sim_adc_convert_locked(adc);
	adc->pushed++;
	raw_spin_unlock_irqrestore(&adc->lock, flags);
	return value;
}

/* One conversion, timestamped, for the thread. From hard interrupts. */
void sim_adc_convert_to_fifo(struct sim_adc *adc)
{
	s64 now_ns = iio_get_time_ns(adc->iio);
	struct sim_conversion *conversion;
	unsigned long flags;

	raw_spin_lock_irqsave(&adc->lock, flags);
	sim_adc_convert_locked(adc);
	if (adc->head - adc->tail < SIM_ADC_FIFO) {
		conversion = &adc->fifo[adc->head++ & (SIM_ADC_FIFO - 1)];
		conversion->t_ns = now_ns;
		conversion->value = adc->value;
	} else {
		adc->lost++;
	}
	raw_spin_unlock_irqrestore(&adc->lock, flags);
}

bool sim_adc_take(struct sim_adc *adc, struct sim_conversion *conversion)
{
	unsigned long flags;
	bool some;

	raw_spin_lock_irqsave(&adc->lock, flags);
	some = adc->head != adc->tail;
	if (some)
		*conversion = adc->fifo[adc->tail++ & (SIM_ADC_FIFO - 1)];
	raw_spin_unlock_irqrestore(&adc->lock, flags);
	return some;
}

/* Samples that the last buffer left do not belong to the next one. */
void sim_adc_start(struct sim_adc *adc)
{
	unsigned long flags;

	raw_spin_lock_irqsave(&adc->lock, flags);
	adc->lost += adc->head - adc->tail;
	adc->tail = adc->head;
	adc->waveform.cursor = 0;
	raw_spin_unlock_irqrestore(&adc->lock, flags);
}

static int sim_waveform_open(struct inode *inode, struct file *file)
{
	file->private_data = inode->i_private;
	return stream_open(inode, file);
}

static ssize_t sim_waveform_write(struct file *file, const char __user *from, size_t size,
				  loff_t *unused)
{
	struct sim_adc *adc = file->private_data;
	struct sim_waveform *waveform = &adc->waveform;
	u32 count, capacity, tail, i;
	ssize_t ret;
	u16 *sample;

	if (!size || size % sizeof(*sample))
		return -EINVAL;
	count = min_t(size_t, size / sizeof(*sample), SIM_WAVEFORM_CHUNK);
	sample = memdup_user(from, count * sizeof(*sample));
	if (IS_ERR(sample))
		return PTR_ERR(sample);
	ret = -EINVAL;
	for (i = 0; i < count; i++)
		if (sample[i] > INCISE_SIM_ADC_MAX)
			goto out_free;

	ret = -ERESTARTSYS;
	if (mutex_lock_interruptible(&waveform->writer))
		goto out_free;
	/* acquire: the converter has read what is overwritten here */
	tail = smp_load_acquire(&waveform->tail);
	capacity = INCISE_SIM_ADC_WAVEFORM - (waveform->head - tail);
	count = min(count, capacity);
	for (i = 0; i < count; i++)
		*sim_waveform_at(waveform, waveform->head + i) = sample[i];
	/* release: samples are there before the converter sees them */
	smp_store_release(&waveform->head, waveform->head + count);
	mutex_unlock(&waveform->writer);
	ret = count ? count * sizeof(*sample) : -ENOSPC;
out_free:
	kfree(sample);
	return ret;
}

static const struct file_operations sim_waveform_fops = {
	.owner = THIS_MODULE,
	.open = sim_waveform_open,
	.write = sim_waveform_write,
};

static int sim_control_apply(struct sim_adc *adc, const char *word)
{
	struct sim_waveform *waveform = &adc->waveform;
	unsigned long flags;
	int ret = 0;

	mutex_lock(&waveform->writer);
	raw_spin_lock_irqsave(&adc->lock, flags);
	if (!strcmp(word, "repeat") || !strcmp(word, "once")) {
		waveform->repeat = *word == 'r';
		waveform->cursor = 0;
	} else if (!strcmp(word, "clear")) {
		waveform->tail = waveform->head;
		waveform->cursor = 0;
	} else if (!strcmp(word, "reset")) {
		adc->conversions = 0;
		adc->pushed = 0;
		adc->overflows = 0;
		adc->lost = 0;
		adc->skipped = 0;
		adc->underruns = 0;
	} else {
		ret = -EINVAL;
	}
	raw_spin_unlock_irqrestore(&adc->lock, flags);
	mutex_unlock(&waveform->writer);
	return ret;
}

static int sim_control_parse(void *of, char *text)
{
	char *word = sim_text_word(&text);

	if (!word || sim_text_word(&text))
		return -EINVAL;
	return sim_control_apply(of, word);
}

static ssize_t sim_control_write(struct file *file, const char __user *from, size_t size,
				 loff_t *unused)
{
	return sim_text_write(from, size, sim_control_parse, file->private_data);
}

static const struct file_operations sim_control_fops = {
	.owner = THIS_MODULE,
	.open = sim_waveform_open,
	.write = sim_control_write,
};

static int sim_adc_status_show(struct seq_file *seq, void *unused)
{
	struct sim_adc *adc = seq->private;
	u64 conversions, pushed, overflows, lost, skipped, underruns;
	unsigned long flags;
	u32 held, queued;
	bool repeat;

	raw_spin_lock_irqsave(&adc->lock, flags);
	conversions = adc->conversions;
	pushed = adc->pushed;
	overflows = adc->overflows;
	lost = adc->lost;
	skipped = adc->skipped;
	underruns = adc->underruns;
	held = adc->head - adc->tail;
	queued = READ_ONCE(adc->waveform.head) - adc->waveform.tail;
	repeat = adc->waveform.repeat;
	raw_spin_unlock_irqrestore(&adc->lock, flags);

	seq_printf(seq, "conversions=%llu\n", conversions);
	seq_printf(seq, "pushed=%llu\n", pushed);
	seq_printf(seq, "held=%u\n", held);
	seq_printf(seq, "overflows=%llu\n", overflows);
	seq_printf(seq, "lost=%llu\n", lost);
	seq_printf(seq, "skipped=%llu\n", skipped);
	seq_printf(seq, "underruns=%llu\n", underruns);
	seq_printf(seq, "queued=%u\n", queued);
	seq_printf(seq, "mode=%s\n", repeat ? "repeat" : "once");
	return 0;
}
DEFINE_SHOW_ATTRIBUTE(sim_adc_status);

void sim_adc_files(struct sim_adc *adc, struct dentry *parent)
{
	adc->dir = debugfs_create_dir("adc", parent);
	debugfs_create_file("waveform", 0200, adc->dir, adc, &sim_waveform_fops);
	debugfs_create_file("control", 0200, adc->dir, adc, &sim_control_fops);
	debugfs_create_file("status", 0400, adc->dir, adc, &sim_adc_status_fops);
}

int sim_adc_init(struct sim_adc *adc)
{
	raw_spin_lock_init(&adc->lock);
	mutex_init(&adc->waveform.writer);
	adc->value = INCISE_SIM_ADC_ZERO;
	adc->waveform.repeat = true;
	adc->waveform.sample =
		vcalloc(INCISE_SIM_ADC_WAVEFORM, sizeof(*adc->waveform.sample));
	return adc->waveform.sample ? 0 : -ENOMEM;
}

void sim_adc_free(struct sim_adc *adc)
{
	vfree(adc->waveform.sample);
}
