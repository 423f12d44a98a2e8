def crafted_texts():
    return {}
